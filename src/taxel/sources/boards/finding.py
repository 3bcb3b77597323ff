"""Which serial boards are plugged in, for `taxel find`.

Looks at what the system says of each port; opens none, so that no board restarts.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from taxel.errors import MissingExtra

_BY_ID = Path("/dev/serial/by-id")
"""Where udev names ports by their device's serial number."""


def list_boards(by_id: Path = _BY_ID) -> list[dict[str, Any]]:
    """Return the serial ports that a USB device is behind, sorted by path.

    Each has path, by_id (the name that stays the same whichever socket the board is in;
    empty where there is none), serial (empty where the chip has none), vid_pid such as
    "2341:0042", product and address: what `open_source` takes. Ports of the mainboard are left out.

    Raises:
        MissingExtra: pyserial is not installed.
    """
    try:
        from serial.tools import list_ports
    except ModuleNotFoundError as error:
        raise MissingExtra("pyserial", "serial", "finding boards") from error
    stable = _links(by_id)
    boards = []
    for port in list_ports.comports():
        if port.vid is None:
            continue
        name = stable.get(os.path.realpath(port.device), "")
        boards.append(
            {
                "path": port.device,
                "by_id": name,
                "serial": port.serial_number or "",
                "vid_pid": f"{port.vid:04x}:{port.pid:04x}",
                "product": port.product or port.description or "",
                "address": f"serial://{name or port.device}",
            }
        )
    return sorted(boards, key=lambda board: str(board["path"]))


def _links(by_id: Path) -> dict[str, str]:
    """Return device → its lasting name."""
    if not by_id.is_dir():
        return {}
    return {os.path.realpath(link): str(link) for link in sorted(by_id.iterdir())}
