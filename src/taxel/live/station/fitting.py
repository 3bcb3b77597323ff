"""Which bundle watches which source. Knows nothing about processes."""

from __future__ import annotations

from pathlib import Path

from taxel.bundles.contract import Contract
from taxel.bundles.envelope import is_grasp_bundle
from taxel.bundles.grasp import GraspContract, read_grasp_contract
from taxel.bundles.reader import read_contract
from taxel.bundles.signing import Trust
from taxel.errors import BadBundle
from taxel.signals import CameraInfo, SensorInfo


def read_own_contract(path: Path, trust: Trust | None = None) -> Contract | GraspContract:
    """Return the contract of an array's bundle, or of one that watches a grasp.

    Raises:
        BadBundle: The bundle cannot be read, or is not signed by a key of `trust`.
    """
    return read_grasp_contract(path, trust) if is_grasp_bundle(path) else read_contract(path, trust)


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
        else:
            contract.check_sensor(sensor)
    except BadBundle as error:
        return error
    return None
