"""`taxel find`: which boards and cameras are plugged in, and what to write to open them."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from taxel.cli.printing import command, print_json, say
from taxel.errors import BadSource, MissingExtra

if TYPE_CHECKING:
    from taxel.sources.realsense_device import FoundRealSense
    from taxel.sources.v4l2_nodes import FoundCamera

_NEAR_PX = 640 * 480
"""A size that several cameras share is chosen near this one, pixels."""


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
        addresses = [*ready_addresses(boards, cameras), *(one.address for one in scene)]
        if self.json:
            print_json(
                {
                    "boards": boards,
                    "cameras": [one.as_dict() for one in cameras],
                    "scene_cameras": [asdict(one) for one in scene],
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


def find_boards() -> tuple[list[dict[str, Any]], list[str]]:
    """Return the boards, and why they could not be looked for."""
    try:
        from taxel.sources.board_finding import list_boards

        return list_boards(), []
    except MissingExtra as error:
        return [], [str(error)]


def find_cameras() -> list[FoundCamera]:
    """Return the cameras; none on a system without Video4Linux."""
    if sys.platform != "linux":
        return []
    from taxel.sources.v4l2_nodes import list_cameras

    return list_cameras()


def find_scene_cameras() -> tuple[list[FoundRealSense], list[str]]:
    """Return RealSense cameras, and why they could not be looked for; nothing without the extra."""
    from taxel.sources.realsense_device import list_realsense

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
        found.append("serial://" + ",".join(one.removeprefix("serial://") for one in found))
    usable = [one for one in cameras if one.address]
    found += [one.address for one in usable]
    size = shared_size(usable)
    if len(usable) > 1 and size is not None:
        paths = ",".join(one.by_id or one.path for one in usable)
        found.append(f"camera://{paths}?width={size[0]}&height={size[1]}")
    return found


def shared_size(cameras: Sequence[FoundCamera]) -> tuple[int, int] | None:
    """Return the JPEG size nearest to 640×480 that all cameras offer; None where there is none."""
    each = [{(one.width, one.height) for one in c.offers if one.is_jpeg} for c in cameras]
    shared = set.intersection(*each) if each else set()
    return min(shared, key=lambda size: (abs(size[0] * size[1] - _NEAR_PX), size), default=None)


def board_lines(boards: Sequence[Mapping[str, Any]], problems: Sequence[str]) -> list[str]:
    """Return what is said about boards."""
    if problems:
        return [f"boards: not looked for: {problem}" for problem in problems]
    if not boards:
        return ["boards: none. Plug one in by USB; if it stays unseen, run: taxel doctor"]
    lines = ["boards:"]
    for one in boards:
        serial = one["serial"] or "none"
        lines.append(f"  {one['product'] or 'unnamed'} ({one['vid_pid']}), serial number {serial}")
        lines.append(f"    {one['path']}{_also(one['by_id'])}")
    return lines


def camera_lines(cameras: Sequence[FoundCamera]) -> list[str]:
    """Return what is said about cameras."""
    if not cameras:
        return ["cameras: none. Plug one in by USB; if it stays unseen, run: taxel doctor"]
    lines = ["cameras:"]
    for one in cameras:
        if one.problem:
            lines.append(f"  {one.path}{_also(one.by_id)}: {one.problem}; run: taxel doctor")
            continue
        lines.append(f"  {one.card or 'unnamed'}, serial number {one.serial or 'none'}, {one.bus}")
        lines.append(f"    {one.path}{_also(one.by_id)}")
        offers = [str(offer) for offer in one.offers if offer.is_jpeg]
        lines.append(f"    MJPG {'; '.join(offers)}" if offers else "    no MJPG: cannot be used")
    return lines


def scene_lines(cameras: Sequence[FoundRealSense], problems: Sequence[str]) -> list[str]:
    """Return what is said about cameras that look on: a line each, none where there are none."""
    lines = [f"scene cameras: not looked for: {problem}" for problem in problems]
    for one in cameras:
        port = f", USB {one.usb}" if one.usb else ""
        lines.append(f"scene camera: {one.name}, serial number {one.serial}{port}")
    return lines


def _also(by_id: str) -> str:
    return f" = {by_id}" if by_id else ""
