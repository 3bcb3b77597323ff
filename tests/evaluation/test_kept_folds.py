"""Kept folds are used for the same data and code only; nothing else is removed with them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.evaluation import kept_folds
from taxel.evaluation.crossval import FoldPredictions
from taxel.evaluation.kept_folds import KeptFolds, folds_folder, forget_folds
from taxel.evaluation.splits import WindowFold
from taxel.jobs import call
from taxel.recordings.whole import whole_file

Y = np.array([0, 1, 0])
SHARES = np.array([[0.9, 0.1], [0.2, 0.8], [0.7, 0.3]])
RESULT = FoldPredictions("first", np.array([0, 1, 2]), Y, SHARES)
FOLD = WindowFold("first", np.arange(3, 6), np.arange(3))


def kept(output: Path, *, fresh: bool = False) -> KeptFolds:
    return KeptFolds(folds_folder(output), {"seed": 0}, make_dataset(), "shape", fresh=fresh)


def test_a_fold_comes_back_as_it_was(tmp_path: Path):
    kept(tmp_path / "run").keep("cnn", 0, RESULT)
    found = kept(tmp_path / "run").find("cnn", 0, FOLD)
    assert found is not None
    for name in ("test", "y", "probabilities"):
        assert np.array_equal(getattr(found, name), getattr(RESULT, name))
        assert getattr(found, name).dtype == getattr(RESULT, name).dtype


def test_a_fold_of_code_that_was_changed_since_is_fitted_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """In a tree that was changed already the commit says `+` before and after."""
    kept(tmp_path / "run").keep("cnn", 0, RESULT)
    package = tmp_path / "taxel"
    package.mkdir()
    (package / "__init__.py").write_text("changed = True\n")
    monkeypatch.setattr(call.taxel, "__file__", str(package / "__init__.py"))
    call.code_digest.cache_clear()
    try:
        assert kept(tmp_path / "run").find("cnn", 0, FOLD) is None
    finally:
        call.code_digest.cache_clear()


@pytest.mark.parametrize("at", range(0, 80, 4))
def test_a_fold_with_a_damaged_byte_is_fitted_again_or_whole(at: int, tmp_path: Path):
    """The first member's head and the list of members at the end."""
    folds = kept(tmp_path / "run")
    folds.keep("cnn", 0, RESULT)
    (path,) = folds_folder(tmp_path / "run").iterdir()
    content = bytearray(path.read_bytes())
    for place in (*range(at, at + 4), len(content) - 1 - at):
        damaged = content.copy()
        damaged[place] ^= 0xFF
        path.write_bytes(damaged)
        found = folds.find("cnn", 0, FOLD)
        assert found is None or np.array_equal(found.probabilities, SHARES)


def test_what_is_no_fold_stays_where_folds_are_removed(tmp_path: Path):
    folds = kept(tmp_path / "run")
    folds.keep("cnn", 0, RESULT)
    notes = folds_folder(tmp_path / "run") / "notes.txt"
    notes.write_text("mine")
    forget_folds(tmp_path / "run")
    assert [path.name for path in notes.parent.iterdir()] == ["notes.txt"]
    kept(tmp_path / "other").keep("cnn", 0, RESULT)
    kept(tmp_path / "other", fresh=True)
    assert not folds_folder(tmp_path / "other").exists()


def shared(folder: Path, seed: int = 0) -> KeptFolds:
    return KeptFolds(folder, {"seed": seed}, make_dataset(), "shape", fresh=False, shared=True)


def test_what_a_killed_command_left_goes_with_the_folds(tmp_path: Path):
    """It was killed while it wrote one: the folder in which it did has no owner."""
    kept(tmp_path / "run").keep("cnn", 0, RESULT)
    folder = folds_folder(tmp_path / "run")
    with pytest.MonkeyPatch.context() as killed, whole_file(folder / "cnn-1.npz") as made:
        made.write_bytes(b"half")
        killed.setattr(shutil, "rmtree", lambda *_, **__: None)
        killed.setattr(os, "replace", lambda *_: None)

    forget_folds(tmp_path / "run")

    assert not folder.exists()


def test_a_shared_folder_keeps_the_latest_data_sets_and_splits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Each has a folder of its own in it; the oldest give way."""
    monkeypatch.setattr(kept_folds, "MOST_SHARED", 2)
    for seed in range(4):
        shared(tmp_path / "cache", seed).keep("forest", 0, RESULT)
        for age, path in enumerate(sorted((tmp_path / "cache").iterdir(), key=_made)):
            os.utime(path, (1000 + age, 1000 + age))

    assert [shared(tmp_path / "cache", n).find("forest", 0, FOLD) is not None for n in range(4)] \
        == [False, False, True, True]  # fmt: skip


def test_a_cache_that_cannot_be_written_is_no_error(tmp_path: Path):
    """The figures do not depend on it."""
    (tmp_path / "cache").write_text("a file where the folder should be")
    folds = shared(tmp_path / "cache")
    folds.keep("forest", 0, RESULT)

    assert folds.find("forest", 0, FOLD) is None


def _made(path: Path) -> float:
    return path.stat().st_mtime
