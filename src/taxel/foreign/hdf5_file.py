"""Open HDF5 files, and MATLAB's .mat files of version 7.3, which are HDF5.

Read by h5py, which is loaded only here. Nothing leads out of the file: soft and external links,
values in other files and virtual arrays are not followed. A filter that HDF5 would have to load
is refused, and so is an array whose pieces were never written, since they would read as zeros.
Knows nothing about what the arrays mean.

Background of our choices: docs/decisions/0011 and 0034.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, MissingExtra
from taxel.foreign.files import MIB, in_words, open_file, refuse_larger, size_of
from taxel.foreign.hdf5_trial import try_hdf5
from taxel.foreign.held_arrays import (
    LONGEST_TEXT,
    MOST_NAMES,
    Cells,
    Held,
    Numbers,
    Texts,
    attributes_in,
    sides_of,
)
from taxel.foreign.npz_file import LARGEST_STACK, plain_text_of, texts_of
from taxel.plain_text import number_of

SIGN = b"\x89HDF\r\n\x1a\n"
MATLAB_BLOCK = 512
"""Bytes of MATLAB's own before HDF5's first."""
_MATLAB = b"MATLAB"
_DEEPEST = 16
"""Groups within groups. Source: our choice."""
_FILTERS = {1: "deflate", 2: "shuffle", 3: "fletcher32", 4: "szip", 5: "nbit", 6: "scaleoffset",
            32000: "lzf"}  # fmt: skip
"""What comes with HDF5 and h5py; another would be loaded from a folder of plug-ins."""
_LARGEST_CHUNK = 512 * MIB
"""Bytes of a piece, which HDF5 unpacks as a whole. Source: our choice."""
_TEXTS_AT_ONCE = 64 * MIB
_CLASSES = ("double", "single", "logical", "char", "int8", "uint8", "int16", "uint16", "int32",
            "uint32", "int64", "uint64")  # fmt: skip
"""What MATLAB calls arrays of numbers and letters."""
_HIDDEN = ("#refs#", "#subsystem#")


class Hdf5File:
    """An HDF5 file: arrays by their paths, trials/3/force, and attributes, trials/3@object.

    Args:
        path: The file.

    Raises:
        BadFile: It is no whole HDF5 file.
        MissingExtra: h5py is not installed.
    """

    def __init__(self, path: Path) -> None:
        with open_file(path) as file:
            self._size = size_of(file)
            refuse_larger(path, self._size, LARGEST_STACK)
            head = file.read(MATLAB_BLOCK + len(SIGN))
        matlab = head.startswith(_MATLAB) and head.endswith(SIGN)
        try:
            import h5py
        except ModuleNotFoundError as error:
            raise MissingExtra("h5py", "hdf5", "HDF5 and MATLAB 7.3 files") from error
        try_hdf5(path)
        self._h5, self._matlab = h5py, matlab
        try:
            self._file = h5py.File(path, "r", locking=False)
        except (OSError, RuntimeError, ValueError) as error:
            raise _broken(error) from error
        self._arrays: dict[str, Any] = {}
        self._groups: dict[str, Any] = {"": self._file}
        try:
            self._walk(self._file, "", {self._address(self._file)}, 0)
        except BadFile:
            self._file.close()
            raise
        except _BROKEN as error:
            self._file.close()
            raise _broken(error) from error

    def names(self) -> Sequence[str]:
        """Return the arrays' paths; MATLAB's own names, as data.force, in its files."""
        return tuple(self._arrays)

    def get(self, name: str) -> Held:
        """Return an array or an attribute.

        Raises:
            KeyError: There is none of that name.
            BadFile: It is damaged, of a kind that is not taken, or leads out of the file.
        """
        path, attribute = attributes_in(name)
        held = self._arrays.get(path)
        if held is None and attribute:
            held = self._groups.get(path)
        if held is None:
            raise KeyError(name)
        try:
            if not attribute:
                return self._held(held)
            if attribute in held.attrs:
                return self._attribute(held.attrs[attribute])
        except BadFile as error:
            raise BadFile(error.needed, f"{name}: {error.got}", error.mend) from error
        except _BROKEN as error:
            raise _broken(error) from error
        raise KeyError(name)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _address(self, item: Any) -> object:
        return self._h5.h5o.get_info(item.id).addr

    def _walk(self, group: Any, above: str, over: set[object], depth: int) -> None:
        """Note all arrays of a group, by hard links only, none of them within itself."""
        for name in group:
            if not isinstance(group.get(name, getlink=True), self._h5.HardLink):
                continue
            if depth == 0 and self._matlab and name in _HIDDEN:
                continue
            if len(self._arrays) + len(self._groups) > MOST_NAMES:
                raise BadFile(f"at most {MOST_NAMES:,} arrays", "more", "split the file")
            kind = group.get(name, getclass=True)
            path = f"{above}{'.' if self._matlab else '/'}{name}" if above else name
            if kind is self._h5.Dataset:
                self._arrays[path] = group[name]
            elif kind is self._h5.Group:
                inner = group[name]
                address = self._address(inner)
                if address in over or depth >= _DEEPEST:
                    continue
                self._groups[path] = inner
                self._walk(inner, path, over | {address}, depth + 1)

    def _held(self, dataset: Any) -> Held:
        if self._h5.check_ref_dtype(dataset.dtype) is self._h5.Reference:
            return Cells(tuple(self._items(dataset)))
        return self._single(dataset)

    def _items(self, dataset: Any) -> Iterator[Numbers | Texts]:
        """Yield what cells hold; many of them may lead to the same list of texts."""
        texts = 0
        for item in self._cells(dataset):
            held = self._single(item)
            texts += len(held.values) if isinstance(held, Texts) else 0
            if texts > MOST_NAMES:
                raise BadFile(f"cells of at most {MOST_NAMES:,} texts", "more", "split the file")
            yield held

    def _cells(self, dataset: Any) -> Iterator[Any]:
        """Yield what MATLAB's cells hold, in its own order."""
        self._check(dataset)
        if dataset.size > MOST_NAMES:
            raise BadFile(f"at most {MOST_NAMES:,} cells", f"{dataset.size:,}", "split the file")
        for reference in dataset[()].ravel():  # HDF5's axes are MATLAB's from the last to the first
            item = self._file[reference] if reference else None
            if not isinstance(item, self._h5.Dataset):
                raise BadFile("cells of numbers or texts", "others", "save them so")
            yield item

    def _single(self, dataset: Any) -> Numbers | Texts:
        """Return an array that holds no others."""
        self._check(dataset)
        if self._h5.check_string_dtype(dataset.dtype) is not None:
            return self._texts(dataset)
        if names := self._h5.check_enum_dtype(dataset.dtype):
            return _named(dataset, names)
        if self._matlab and (kind := _class_of(dataset)) not in _CLASSES:
            raise BadFile("numbers, texts or cells of them", f"MATLAB's {kind}",
                          "save it as one of them; texts as cellstr(…)")  # fmt: skip
        if self._matlab and _class_of(dataset) == "char":
            return self._letters(dataset)
        if dataset.attrs.get("MATLAB_empty", 0):
            return Numbers.of(np.zeros(0))
        if dataset.dtype.names:
            raise BadFile("numbers or texts", "records with named fields "
                          f"({', '.join(dataset.dtype.names)[:80]})",
                          "write each field as an array of its own")  # fmt: skip
        if dataset.dtype.kind not in "biufc":
            raise BadFile("numbers or texts", f"values of the kind {dataset.dtype}", "write it so")
        if self._matlab:  # HDF5's axes are MATLAB's from the last to the first
            return Numbers(
                dataset.shape[::-1], dataset.dtype, lambda places: _read(dataset, places[::-1]).T
            )
        return Numbers(dataset.shape, dataset.dtype, lambda places: _read(dataset, places))

    def _check(self, dataset: Any) -> None:
        """Refuse values that are not in the file, or only HDF5's own guess."""
        made = dataset.id.get_create_plist()
        if dataset.is_virtual or made.get_external_count():
            raise BadFile("arrays whose values are in the file", "one whose values are in another",
                          "copy it with its values")  # fmt: skip
        filters = [made.get_filter(n)[0] for n in range(made.get_nfilters())]
        if odd := [number for number in filters if number not in _FILTERS]:
            raise BadFile(
                "arrays packed by gzip or lzf, or not at all", f"one packed by the filter {odd[0]}",
                "write it again, as with h5repack -f GZIP=4",
            )  # fmt: skip
        if dataset.shape is None:
            raise BadFile("numbers or texts", "an array without a shape", "write it again")
        if not dataset.size:
            return
        if dataset.chunks is not None:
            _check_chunks(dataset)
        elif made.get_layout() == self._h5.h5d.CONTIGUOUS and not dataset.id.get_storage_size():
            raise BadFile("values", f"a shape of {sides_of(dataset.shape)} without any",
                          "write them")  # fmt: skip

    def _texts(self, dataset: Any) -> Texts:
        if dataset.size is None or dataset.size > MOST_NAMES or dataset.ndim > 2:
            raise BadFile(f"a list of at most {MOST_NAMES:,} texts", f"{dataset.size}", "split it")
        if dataset.dtype.kind != "S":
            return Texts(tuple(_text(value) for value in self._few_at_once(dataset)))
        if dataset.nbytes > _TEXTS_AT_ONCE:
            raise BadFile(f"texts of at most {in_words(_TEXTS_AT_ONCE)}", in_words(dataset.nbytes),
                          "shorten them")  # fmt: skip
        return texts_of(np.asarray(dataset[()]))

    def _few_at_once(self, dataset: Any) -> Iterator[object]:
        """Yield texts, each of which may lead to the same large piece of the file."""
        rows, columns = (*tuple[int, ...](dataset.shape), 1, 1)[:2]
        step = min(max(1, _TEXTS_AT_ONCE // max(1, self._size)), 4096)
        down = max(1, step // max(1, columns))
        for top in range(0, rows, down):
            for left in range(0, columns, step):
                places = (slice(top, top + down), slice(left, left + step))[: dataset.ndim]
                yield from np.asarray(dataset[places], object).ravel().tolist()

    def _letters(self, dataset: Any) -> Texts:
        """Return MATLAB's letters: a text for each of its rows."""
        if dataset.attrs.get("MATLAB_empty", 0):
            return Texts(("",))
        if dataset.ndim != 2 or dataset.size > MOST_NAMES * 64 or dataset.dtype.kind != "u":
            raise BadFile("texts in rows", f"letters of {sides_of(dataset.shape)}", "use cellstr")
        letters = np.asarray(dataset[()]).T
        return Texts(tuple(
            plain_text_of(row.astype("<u2").tobytes().decode("utf-16-le")) for row in letters
        ))  # fmt: skip

    def _attribute(self, value: Any) -> Held:
        if isinstance(value, str | bytes):
            return Texts((plain_text_of(value),))
        array = np.asarray(value)
        if array.dtype.kind == "O":
            return Texts(tuple(_text(item) for item in array.ravel().tolist()))
        if array.dtype.kind in "US":
            return texts_of(array)
        if array.dtype.kind not in "biuf":
            raise BadFile("numbers or texts", f"values of the kind {array.dtype}", "write it so")
        return Numbers.of(array)


def _named(dataset: Any, names: Mapping[str, int]) -> Texts:
    """Return the names of an enumeration's values; a number without one is written as it is."""
    if dataset.size > MOST_NAMES:
        raise BadFile(f"at most {MOST_NAMES:,} names", f"{dataset.size:,}", "write numbers")
    of = {number: name for name, number in names.items()}
    return Texts(tuple(
        plain_text_of(of.get(number, str(number)))
        for number in np.asarray(dataset[()]).ravel().tolist()
    ))  # fmt: skip


def _class_of(dataset: Any) -> str:
    """Return what MATLAB calls the kind of an array; of one without a word of it, double."""
    kind = dataset.attrs.get("MATLAB_class", b"double")
    if "MATLAB_object_decode" in dataset.attrs or not isinstance(kind, bytes):
        return "object" if not isinstance(kind, bytes) else f"{kind.decode('latin-1')} object"
    return kind.decode("latin-1")


def _read(dataset: Any, places: tuple[slice, ...]) -> NDArray[Any]:
    try:
        return np.asarray(dataset[places])
    except _BROKEN as error:
        raise _broken(error) from error


def _check_chunks(dataset: Any) -> None:
    pieces = math.prod(
        -(-side // piece) for side, piece in zip(dataset.shape, dataset.chunks, strict=True)
    )
    if math.prod(dataset.chunks) * dataset.dtype.itemsize > _LARGEST_CHUNK:
        raise BadFile("pieces (chunks) of at most 512 MiB", sides_of(dataset.chunks), "write it so")
    written = dataset.id.get_num_chunks()
    if written < pieces:
        raise BadFile(
            f"all of {number_of(pieces, 'piece', ',')} (chunks)",
            f"{written:,}; the rest would read as zeros",
            "write them, or shorten the array",
        )  # fmt: skip


def _text(value: object) -> str:
    if not isinstance(value, str | bytes) or len(value) > LONGEST_TEXT:
        raise BadFile(f"texts of at most {LONGEST_TEXT} characters", "others", "write them so")
    return plain_text_of(value)


_BROKEN = (OSError, RuntimeError, ValueError, TypeError, KeyError, IndexError, AttributeError,
           OverflowError, MemoryError, NotImplementedError)  # fmt: skip


def _broken(error: BaseException) -> BadFile:
    return BadFile("a whole HDF5 file", f"a damaged one ({' '.join(str(error).split())})",
                   "copy it again")  # fmt: skip
