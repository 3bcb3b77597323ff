"""Which bundle watches which source. Knows nothing about processes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from taxel.bundles.contract import Contract
from taxel.bundles.envelope import is_grasp_bundle, is_trial_bundle
from taxel.bundles.grasp import GraspContract, read_grasp_contract
from taxel.bundles.reader import read_contract
from taxel.bundles.signing import Trust
from taxel.errors import BadBundle
from taxel.signals import CameraInfo, SensorInfo

if TYPE_CHECKING:
    from taxel.bundles.trials import TrialContract


def read_own_contract(
    path: Path, trust: Trust | None = None
) -> Contract | GraspContract | TrialContract:
    """Return the contract of an array's bundle, of camera trials, or of one that watches a grasp.

    Raises:
        BadBundle: The bundle cannot be read, or is not signed by a key of `trust`.
    """
    if is_grasp_bundle(path):
        return read_grasp_contract(path, trust)
    if is_trial_bundle(path):
        from taxel.bundles.trials import read_trial_contract  # needs the extra of cameras

        return read_trial_contract(path, trust)
    return read_contract(path, trust)


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
    contract = read_own_contract(path, trust)
    try:
        if isinstance(contract, GraspContract):
            contract.check_cameras(cameras)
        elif isinstance(contract, Contract):
            contract.check_sensor(sensor)
        else:
            contract.check(
                [camera.name for camera in cameras],
                [(camera.width, camera.height) for camera in cameras],
                [camera.rate_hz for camera in cameras],
            )
    except BadBundle as error:
        return error
    return None
