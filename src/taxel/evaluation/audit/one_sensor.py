"""Recordings that are audited together are of one sensor: checks compare column by column.

Knows nothing about trials or values.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from taxel.errors import BadDataset
from taxel.plain_text import number_of
from taxel.signals import CameraInfo, SensorInfo
from taxel.windows.checks import check_sensor
from taxel.windows.config import WindowConfig


def check_alike(first: SensorInfo, own: SensorInfo, path: Path) -> None:
    """Refuse an array's recording of other channels than the first one's, or in another order.

    Raises:
        BadDataset: It is one.
    """
    check_sensor(first, own, path, WindowConfig(steps=1, stride=1))


def check_cameras(first: Sequence[CameraInfo], own: Sequence[CameraInfo], path: Path) -> None:
    """Refuse a recording of more or fewer cameras than the first one's, or in another order.

    Raises:
        BadDataset: It is one.
    """
    known, found = ([camera.name for camera in cameras] for cameras in (first, own))
    if len(found) != len(known):
        raise BadDataset(f"{number_of(len(known), 'camera')} in every recording",
                         f"others in {path.name}", "put them in folders of their own")  # fmt: skip
    if found != known and sorted(found) == sorted(known):
        raise BadDataset(f"the cameras {', '.join(known)} in this order in every recording",
                         f"{', '.join(found)} in {path.name}",
                         "record or import them anew in one order")  # fmt: skip
