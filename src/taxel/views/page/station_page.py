"""The page's process under a station's supervisor. Knows nothing about sensors."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from taxel.live.station.page_link import StationView, ViewConfig
from taxel.live.station.worker import Place, at_work
from taxel.views.page.server import PageServer

_BEAT_S = 0.1
"""Time between two signs of life of the page's process, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StationPage:
    """The job of the process that serves the operator's page of a station."""

    place: Place
    view: ViewConfig
    host: str = "127.0.0.1"
    port: int = 0
    token: str | None = None


def show(job: StationPage) -> None:
    """Serve the page until asked to end; the entry point of the process."""
    with at_work(job.place) as pulse:
        view = StationView(job.view)
        try:
            with PageServer(view, job.host, job.port, job.token) as server:
                pulse.report("opened", server.url)
                waiting = threading.Event()
                while not pulse.stopping and server.running:
                    pulse.beat()
                    waiting.wait(_BEAT_S)
        finally:
            view.close()
