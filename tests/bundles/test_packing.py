"""What a bundle holds is packed on disk, and what was packed can be read again."""

from pathlib import Path

import numpy as np

from taxel.bundles.envelope import pack, to_npy, unpack
from taxel.foreign.files import MIB

NAMES = ("trials.json", "model.onnx")


def written(folder: Path, model: bytes) -> tuple[int, bytes]:
    """Return a bundle's size, and the model that is read from it."""
    path = folder / "own.taxel"
    path.write_bytes(pack({"trials.json": b"{}", "model.onnx": model}))
    return path.stat().st_size, unpack(path, NAMES)["model.onnx"]


def test_tables_of_trees_take_a_fraction_of_the_room_on_disk(tmp_path: Path):
    table = to_npy(np.arange(200_000, dtype=np.int32))

    size, again = written(tmp_path, table)

    assert size < len(table) / 2
    assert again == table


def test_what_packs_so_well_that_it_would_be_refused_is_left_as_it_is(tmp_path: Path):
    size, again = written(tmp_path, bytes(40 * MIB))

    assert size > 40 * MIB
    assert again == bytes(40 * MIB)


def test_the_same_members_give_the_same_bytes():
    members = {"bundle.json": b"{}", "model.onnx": bytes(range(256)) * 50}

    assert pack(members) == pack(dict(members))
