"""The extras of pyproject.toml: which modules each brings, and what for.

For `taxel doctor`, and for the one line that is printed where a verb lacks a package: most modules
name their extra where they import one, and this does it for all others.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Final, NamedTuple

from taxel.errors import MissingExtra


class Extra(NamedTuple):
    """One extra."""

    modules: tuple[str, ...]
    """What is imported of the packages that it brings."""
    purpose: str


LIVE_PACKAGES: Final = ("numpy", "mcap", "lz4", "onnxruntime", "rich", "tyro")
"""Modules that `pip install .` brings, without any extra."""
EXTRAS: Final[Mapping[str, Extra]] = {
    "camera": Extra(("cv2",), "tactile cameras"),
    "serial": Extra(("serial", "cobs"), "sensor boards"),
    "gripper": Extra(("pymodbus", "serial"), "a gripper"),
    "page": Extra(("starlette", "uvicorn", "websockets", "h11"), "the operator's page"),
    "sign": Extra(("cryptography",), "signed bundles"),
    "sim": Extra(("scipy", "cv2"), "the simulators"),
    "train": Extra(
        (
            "torch", "sklearn", "onnx", "safetensors", "aeon", "matplotlib", "psutil",
            "threadpoolctl", "scipy", "cv2", "pywt",
        ),
        "training",
    ),
    "adapt": Extra(("river",), "noticing drift"),
    "bus": Extra(("zenoh", "paho"), "a live bus and a fleet"),
    "dask": Extra(("distributed",), "jobs on Dask"),
    "denoise": Extra(("pywt",), "wavelet denoising"),
    "export": Extra(("pyarrow", "av"), "files for other programs"),
    "fine-tune": Extra(("lightning_fabric",), "training end to end"),
    "hdf5": Extra(("h5py",), "HDF5 files"),
    "openvino": Extra(("openvino", "nncf"), "a second engine"),
    "ray": Extra(("ray",), "jobs on Ray"),
    "realsense": Extra(("pyrealsense2",), "RealSense cameras"),
    "rerun": Extra(("rerun",), "a Rerun viewer"),
    "slurm": Extra(("submitit",), "jobs on SLURM"),
    "tune": Extra(("optuna", "sqlalchemy"), "a search for settings"),
    "xlsx": Extra(("openpyxl",), "Excel workbooks"),
}  # fmt: skip


def need_extra(extra: str, purpose: str) -> None:
    """Refuse work before it begins, where something that an extra brings is not installed.

    Raises:
        MissingExtra: The first module that cannot be found.
    """
    for module in EXTRAS[extra].modules:
        if find_spec(module) is None:
            raise MissingExtra(module, extra, purpose)


def missing_extra(error: ImportError, verb: str, trains: bool) -> MissingExtra | None:
    """Return the refusal that names the extra; None where no extra brings that module.

    Args:
        error: What an import raised; it may name an extra already.
        verb: What needs the module, as in "taxel info".
        trains: It belongs to training or evaluation: those need the extra `train` as a whole, so
            that a part of it, such as `camera`, is not named: the next package would be missing.
    """
    if isinstance(error, MissingExtra):
        brought = EXTRAS.get(error.extra)
        part = brought is not None and set(brought.modules) < set(EXTRAS["train"].modules)
        return MissingExtra(error.package, "train", verb) if trains and part else error
    module = (error.name or "").partition(".")[0]
    found = [extra for extra, brought in EXTRAS.items() if module in brought.modules]
    if not found:
        return None
    return MissingExtra(module, "train" if trains and "train" in found else found[0], verb)
