"""Which bundle watches which source. Knows nothing about processes."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from taxel.bundles.grasp import is_grasp_bundle, read_grasp_contract
from taxel.bundles.reader import read_contract
from taxel.bundles.signing import Trust
from taxel.errors import BadBundle
from taxel.signals import CameraInfo, SensorInfo


def misfit(
    path: Path,
    sensor: SensorInfo,
    cameras: tuple[CameraInfo, ...],
    trust: Trust | None = None,
) -> BadBundle | None:
    """Return why a bundle cannot watch a source; None where it can.

    Raises:
        BadBundle: The bundle cannot be read, or is not signed by a key of `trust`.
    """
    if is_grasp_bundle(path):
        grasp = read_grasp_contract(path, trust)
        check = partial(grasp.check_cameras, cameras)
    else:
        check = partial(read_contract(path, trust).check_sensor, sensor)
    try:
        check()
    except BadBundle as error:
        return error
    return None
