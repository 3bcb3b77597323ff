"""Hypothesis strategies that change one thing in something valid. Not a test itself."""

import json
import struct
from collections.abc import Callable
from copy import deepcopy
from typing import Any

from hypothesis import strategies as st

DEEP, LONG = "@deep@", "@long@"
"""Written as a text of JSON that no object holds: 5,000 lists, and an integer of 5,000 digits."""
NUMBERS = [0, 1, -1, 2, 3, 12, 255, 2**31, 2**32, 2**53, 2**63 - 1, 2**63, -(2**63), 10**30, 0.5,
           -0.0, 1e-320, 1e9, 1e18, 1e308, float("inf"), float("-inf"), float("nan")]  # fmt: skip
TEXTS = ["", " ", "x", "0", "-1", "nan", "1e400", "\0", "\x1b[31m", "é", "\ud800", "a" * 5000,
         "../../etc", "[/red]", "KEY=VALUE:3", "db2", DEEP, LONG]  # fmt: skip
VALUES = st.one_of(
    st.none(), st.booleans(), st.sampled_from(NUMBERS), st.sampled_from(TEXTS),
    st.integers(-5, 5), st.floats(), st.text(max_size=6), st.builds(list), st.builds(dict),
    st.lists(st.sampled_from(NUMBERS), max_size=4), st.lists(st.text(max_size=3), max_size=4),
    st.dictionaries(st.text(max_size=3), st.sampled_from(NUMBERS), max_size=3),
)  # fmt: skip


def places(tree: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the path of every value in a tree of JSON."""
    inner = tree.items() if isinstance(tree, dict) else enumerate(tree[:6])
    found = [above]
    for key, value in inner if isinstance(tree, dict | list) else ():
        found += places(value, (*above, key)) if isinstance(value, dict | list) else [
            (*above, key)
        ]  # fmt: skip
    return found


@st.composite
def changed_json(draw: st.DrawFn, honest: Any) -> bytes:
    """Return a text of JSON in which one or two values are others, gone, doubled or nested."""
    tree = deepcopy(honest)
    for _ in range(draw(st.integers(1, 2))):
        path = draw(st.sampled_from(places(tree)))
        if not path:
            tree = draw(VALUES)
            break
        inner = tree
        for key in path[:-1]:
            inner = inner[key]
        key = path[-1]
        match draw(st.sampled_from(("replace", "replace", "remove", "more", "nest"))):
            case "replace":
                inner[key] = draw(VALUES)
            case "remove":
                del inner[key]
            case "more" if isinstance(inner, dict):
                inner[draw(st.text(max_size=4))] = draw(VALUES)
            case "more":
                inner.insert(key, draw(VALUES))
            case "nest":
                inner[key] = [inner[key]]
        if not isinstance(tree, dict | list):
            break
    text = json.dumps(tree)
    text = text.replace(f'"{DEEP}"', "[" * 5000 + "]" * 5000).replace(f'"{LONG}"', "7" * 5000)
    if draw(st.integers(0, 9)) == 0 and text.startswith("{") and len(text) > 2:
        text = text.replace("{", '{"format": 1, ', 1)  # a name twice
    return text.encode()


@st.composite
def changed_bytes(draw: st.DrawFn, honest: bytes) -> bytes:
    """Return bytes with a few others, a piece missing, doubled or put in."""
    data = bytearray(honest)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(0, len(data) - 1)))
        length = draw(st.integers(0, 12))
        match draw(st.sampled_from(("flip", "set", "word", "cut", "drop", "double", "insert"))):
            case "flip" if data:
                data[at] ^= 1 << draw(st.integers(0, 7))
            case "set":
                data[at : at + 1] = draw(st.sampled_from([b"\0", b"\1", b"\x7f", b"\x80", b"\xff"]))
            case "word":
                words = [0, 1, 0xFF, 2**31 - 1, 2**32 - 1, 2**62, 2**64 - 1]
                data[at : at + 8] = struct.pack("<Q", draw(st.sampled_from(words)))
            case "cut":
                del data[at:]
            case "drop":
                del data[at : at + length]
            case "double":
                data[at:at] = data[at : at + length]
            case _:
                data[at:at] = draw(st.binary(max_size=8))
    return bytes(data)


HEADS = [
    "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }",
    "{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 12), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (1,), }",
    "{'descr': '<f4', 'fortran_order': False, 'shape': (), }",
    "{'descr': '<f4', 'fortran_order': False, 'shape': (0, 12, 12), }",
    "{'descr': '<f4', 'fortran_order': True, 'shape': (16, 12, 12), }",
    "{'descr': '>f8', 'fortran_order': False, 'shape': (16, 3), }",
    "{'descr': '<U9999', 'fortran_order': False, 'shape': (16, 3), }",
    "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (16, 3), }",
    "{'descr': '<f0', 'fortran_order': False, 'shape': (16,), }",
    "{'shape': (" + "9" * 300 + ",), 'descr': '<f4', 'fortran_order': False}",
    "[" * 3000,
]


@st.composite
def changed_npy(draw: st.DrawFn, honest: bytes) -> bytes:
    """Return a .npy file with another head, other bytes, or values that are no numbers."""
    kind = draw(st.sampled_from(("head", "bytes", "values", "values")))
    if kind == "bytes":
        return draw(changed_bytes(honest))
    start = 10 + int.from_bytes(honest[8:10], "little")
    if kind == "values":
        at = start + 4 * draw(st.integers(0, max(0, (len(honest) - start) // 4 - 1)))
        number = struct.pack("<f", draw(st.sampled_from([float("nan"), float("inf"), 1e38, -1.0])))
        return honest[:at] + number + honest[at + 4 :]
    text = draw(st.sampled_from(HEADS)).encode() + b"\n"
    return b"\x93NUMPY\1\0" + len(text).to_bytes(2, "little") + text + honest[start:]


@st.composite
def changed_wav(draw: st.DrawFn, honest: bytes) -> bytes:
    """Return a WAV file with another field in its head, another chunk before it, or other bytes."""
    kind = draw(st.sampled_from(("field", "field", "chunk", "bytes")))
    if kind == "bytes":
        return draw(changed_bytes(honest))
    if kind == "chunk":
        size = draw(st.sampled_from([0, 1, 4, 5, 2**31, 2**32 - 1]))
        return honest[:12] + b"LIST" + struct.pack("<I", size) + b"abcd" + honest[12:]
    fields = [(4, 4), (16, 4), (20, 2), (22, 2), (24, 4), (28, 4), (32, 2), (34, 2),
              (honest.index(b"data") + 4, 4)]  # fmt: skip
    at, width = draw(st.sampled_from(fields))
    number = draw(
        st.sampled_from([0, 1, 2, 3, 8, 16, 24, 55, 64, 0xFFFE, 0xFFFF, 2**31, 2**32 - 1])
    )
    return honest[:at] + (number % 256**width).to_bytes(width, "little") + honest[at + width :]


Change = Callable[[bytes], st.SearchStrategy[bytes]]
