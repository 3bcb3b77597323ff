"""A fleet as a page in the browser: on this machine unless told otherwise, by a key always.

It only shows: nothing on it gives a station an order. Knows nothing about brokers.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from taxel.views.page.assets import Asset, load_folder
from taxel.views.page.guard import Pass
from taxel.views.page.serving import LOOPBACK, Server, make_site

from starlette.requests import Request  # isort: skip
from starlette.responses import Response  # isort: skip
from starlette.routing import Route  # isort: skip

from taxel.views.page.clients import to_json

_OWN = Path(__file__).parent / "static"


class FleetPage:
    """The page's server, in a thread; use it in a `with` block.

    Args:
        snapshot: Gives the fleet's state, at once.
        host: Address to listen on; anything but this machine's own is the caller's decision.
        port: 0 takes a free one.

    Raises:
        BadInput: The address cannot be listened on.
    """

    def __init__(
        self, snapshot: Callable[[], dict[str, Any]], host: str = LOOPBACK, port: int = 0
    ) -> None:
        self._entry = Pass()
        assets: dict[str, Asset] = load_folder(_OWN)

        async def fleet(_: Request) -> Response:
            return Response(to_json(snapshot()), media_type="application/json")

        def site(port: int) -> Any:
            routes = [Route("/fleet.json", fleet)]
            return make_site(assets, "fleet.html", routes, self._entry, host, port)

        self._server = Server(site, host, port)

    @property
    def url(self) -> str:
        """The address to open; its part behind the # is the key."""
        return f"http://{self._server.place}/#{self._entry.token}"

    def __enter__(self) -> FleetPage:
        self._server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()
