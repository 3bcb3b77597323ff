"""Write the same arrays in every form in which tactile data are published. Not a test itself."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat


def write_npz(path: Path, arrays: Mapping[str, Any]) -> None:
    """Arrays as np.savez writes them."""
    np.savez(path, **{name: np.asarray(value) for name, value in arrays.items()})


def write_packed_npz(path: Path, arrays: Mapping[str, Any]) -> None:
    """Arrays as np.savez_compressed writes them."""
    np.savez_compressed(path, **{name: np.asarray(value) for name, value in arrays.items()})


def _for_matlab(value: Any) -> Any:
    array = np.asarray(value)
    return array.astype(object) if array.dtype.kind == "U" else value


def write_mat5(path: Path, arrays: Mapping[str, Any]) -> None:
    """Variables as save(…, '-v6') writes them; texts as a cellstr."""
    savemat(path, {name: _for_matlab(value) for name, value in arrays.items()})


def write_packed_mat5(path: Path, arrays: Mapping[str, Any]) -> None:
    """Variables as save(…, '-v7') writes them."""
    written = {name: _for_matlab(value) for name, value in arrays.items()}
    savemat(path, written, do_compression=True)


def write_hdf5(path: Path, arrays: Mapping[str, Any]) -> None:
    """Datasets, those of numbers in pieces and packed; texts of any length."""
    with h5py.File(path, "w") as file:
        for name, value in arrays.items():
            array = np.asarray(value)
            if array.dtype.kind == "U":
                file[name] = array.astype(object)
            elif array.ndim > 1:
                file.create_dataset(name, data=array, chunks=True, compression="gzip")
            else:
                file[name] = array


def write_mat73(path: Path, arrays: Mapping[str, Any]) -> None:
    """Variables as save(…, '-v7.3') writes them: axes from the last to the first, cells apart."""
    with h5py.File(path, "w", userblock_size=512) as file:
        cells = file.create_group("#refs#")
        for name, value in arrays.items():
            if isinstance(value, list) or np.asarray(value).dtype.kind == "U":
                items = [_v73(cells, f"{name}_{n}", item) for n, item in enumerate(value)]
                references = np.array([[item.ref for item in items]], dtype=h5py.ref_dtype)
                file.create_dataset(name, data=references).attrs["MATLAB_class"] = np.bytes_("cell")
            else:
                _v73(file, name, value)
    with path.open("r+b") as head:
        head.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def _v73(group: Any, name: str, value: Any) -> Any:
    if isinstance(value, str):
        letters = np.frombuffer(value.encode("utf-16-le"), "<u2")[:, None]
        item = group.create_dataset(name, data=letters)
        item.attrs["MATLAB_class"] = np.bytes_("char")
        return item
    item = group.create_dataset(name, data=np.atleast_2d(np.asarray(value)).T)
    item.attrs["MATLAB_class"] = np.bytes_("double")
    return item


FORMS: dict[str, tuple[str, Callable[[Path, Mapping[str, Any]], None]]] = {
    "npz": (".npz", write_npz),
    "packed npz": (".npz", write_packed_npz),
    "MATLAB 5": (".mat", write_mat5),
    "packed MATLAB 5": (".mat", write_packed_mat5),
    "MATLAB 7.3": (".mat", write_mat73),
    "HDF5": (".h5", write_hdf5),
}
"""What a form is called → its ending, and who writes it."""
