"""`taxel find`: which boards and cameras are plugged in, and what to write to open them."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from taxel.cli.printing import command, print_json, say
from taxel.errors import BadSource, MissingExtra

if TYPE_CHECKING:
    from taxel.sources.cameras.realsense_device import FoundRealSense
    from taxel.sources.cameras.v4l2_nodes import FoundCamera

_NEAR_PX = 640 * 480
"""A size that several cameras share is chosen near this one, pixels."""
_MOTORS = (
    "serial:// is for sensor boards. A closed port does not show what its board runs: if it is the "
    "hand's, leave it out and open it with hand://PATH; a gripper's adapter opens with pge://PATH"
)
"""Printed below addresses of boards: a hand's board has the USB name of a sensor board."""


@dataclass(frozen=True, kw_only=True)
class Find:
    """List boards and cameras by serial number, with the address that opens each.

    Nothing is started: ports stay closed, cameras are only asked what they offer.
    """

    json: bool = False
    """Print JSON: {boards, cameras, scene_cameras, addresses, problems}."""

    def run(self) -> None:
        """Look, and print what there is."""
        boards, problems = find_boards()
        cameras = find_cameras()
        scene, why_not = find_scene_cameras()
        addresses = [*ready_addresses(boards, cameras), *(camera.address for camera in scene)]
        if self.json:
            print_json(
                {
                    "boards": boards,
                    "cameras": [camera.as_dict() for camera in cameras],
                    "scene_cameras": [asdict(camera) for camera in scene],
                    "addresses": addresses,
                    "problems": [*problems, *why_not],
                }
            )
            return
        for line in [*board_lines(boards, problems), "", *camera_lines(cameras)]:
            say(line)
        for line in scene_lines(scene, why_not):
            say(line)
        if addresses:
            say("")
            say("ready to use, for example: taxel view ADDRESS")
            for address in addresses:
                say(f"  {command(address)}")
        if boards:
            say(_MOTORS)


def find_boards() -> tuple[list[dict[str, Any]], list[str]]:
    """Return the boards, and why they could not be looked for."""
    try:
        from taxel.sources.boards.finding import list_boards

        return list_boards(), []
    except MissingExtra as error:
        return [], [str(error)]


def find_cameras() -> list[FoundCamera]:
    """Return the cameras; none on a system without Video4Linux."""
    if sys.platform != "linux":
        return []
    from taxel.sources.cameras.v4l2_nodes import list_cameras

    return list_cameras()


def find_scene_cameras() -> tuple[list[FoundRealSense], list[str]]:
    """Return RealSense cameras, and why they could not be looked for; nothing without the extra."""
    from taxel.sources.cameras.realsense_device import list_realsense

    try:
        return list_realsense(), []
    except MissingExtra:
        return [], []
    except BadSource as error:
        return [], [str(error)]


def ready_addresses(
    boards: Sequence[Mapping[str, Any]], cameras: Sequence[FoundCamera]
) -> list[str]:
    """Return one address a device, then those that open all boards, and all cameras, at once."""
    found = [str(board["address"]) for board in boards]
    if len(boards) > 1:
        found.append("serial://" + ",".join(address.removeprefix("serial://") for address in found))
    usable = [camera for camera in cameras if camera.address]
    found += [camera.address for camera in usable]
    size = shared_size(usable)
    if len(usable) > 1 and size is not None:
        paths = ",".join(camera.by_id or camera.path for camera in usable)
        found.append(f"camera://{paths}?width={size[0]}&height={size[1]}")
    return found


def shared_size(cameras: Sequence[FoundCamera]) -> tuple[int, int] | None:
    """Return the JPEG size nearest to 640×480 that all cameras offer; None where there is none."""
    each = [{(offer.width, offer.height) for offer in c.offers if offer.is_jpeg} for c in cameras]
    shared = set.intersection(*each) if each else set()
    return min(shared, key=lambda size: (abs(size[0] * size[1] - _NEAR_PX), size), default=None)


def board_lines(boards: Sequence[Mapping[str, Any]], problems: Sequence[str]) -> list[str]:
    """Return the lines to print about boards."""
    if problems:
        return [f"boards: not looked for: {problem}" for problem in problems]
    if not boards:
        return ["boards: none. Plug one in by USB; if it is still not listed, run: taxel doctor"]
    lines = ["boards:"]
    for board in boards:
        serial = board["serial"] or "none"
        lines.append(
            f"  {board['product'] or 'unnamed'} ({board['vid_pid']}), serial number {serial}"
        )
        lines.append(f"    {board['path']}{_also(board['by_id'])}")
    return lines


def camera_lines(cameras: Sequence[FoundCamera]) -> list[str]:
    """Return the lines to print about tactile cameras."""
    if not cameras:
        return ["cameras: none. Plug one in by USB; if it is still not listed, run: taxel doctor"]
    lines = ["cameras:"]
    for camera in cameras:
        if camera.problem:
            lines.append(
                f"  {camera.path}{_also(camera.by_id)}: {camera.problem}; run: taxel doctor"
            )
            continue
        lines.append(
            f"  {camera.card or 'unnamed'}, serial number {camera.serial or 'none'}, {camera.bus}"
        )
        lines.append(f"    {camera.path}{_also(camera.by_id)}")
        offers = [str(offer) for offer in camera.offers if offer.is_jpeg]
        lines.append(f"    MJPG {'; '.join(offers)}" if offers else "    no MJPG: cannot be used")
    return lines


def scene_lines(cameras: Sequence[FoundRealSense], problems: Sequence[str]) -> list[str]:
    """Return a line to print for each camera that watches the scene."""
    lines = [f"scene cameras: not looked for: {problem}" for problem in problems]
    for camera in cameras:
        port = f", USB {camera.usb}" if camera.usb else ""
        lines.append(f"scene camera: {camera.name}, serial number {camera.serial}{port}")
    return lines


def _also(by_id: str) -> str:
    return f" = {by_id}" if by_id else ""
