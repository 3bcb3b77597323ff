"""A published file of many trials by the verbs alone: import, audit, train, evaluate, live."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from taxel.cli.main import main
from taxel.recordings.reader import read_recording

RECIPE = ["--target", "level", "--model", "cnn1d", "--epochs", "3",
          "--window", "steps=20", "grid=own", "gate=none"]  # fmt: skip
Refused = Callable[[list[str]], str]


def stack(sessions: int, seed: int) -> tuple[Any, Any, Any]:
    """Return presses of two strengths on a pad of 2 × 2: values, levels, sessions."""
    rng = np.random.default_rng(seed)
    levels = np.tile([2, 10], sessions * 2)
    values = rng.normal(levels[:, None, None, None], 0.5, (len(levels), 80, 2, 2))
    return values.astype("f4"), levels, np.repeat(np.arange(sessions), 4)


def printed(capsys: pytest.CaptureFixture[str], *words: object) -> Any:
    """Return the JSON that a command prints."""
    capsys.readouterr()
    main([*map(str, words), "--json"])
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_from_a_published_stack_to_a_live_decision(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One table of two lines: the authors' own training and test part, kept as a split."""
    monkeypatch.chdir(tmp_path)
    (x, y, day), (x_test, y_test, day_test) = stack(2, 0), stack(1, 1)
    np.savez("pad.npz", X_train=x, y_train=y, day_train=day, X_test=x_test, y_test=y_test,
             day_test=day_test + 2)  # fmt: skip
    Path("table.csv").write_text(
        "file,trials,axes,label:level,group:session,group:split,channels,time\n" + "".join(
            f"pad.npz,X_{part},trials rows height width,from:y_{part},from:day_{part},{part},*[N],"
            "rate:100Hz\n"
            for part in ("train", "test")
        )
    )  # fmt: skip
    Path("folds.csv").write_text("group:split,side\ntrain,train\ntest,test\n")

    made = printed(capsys, "import", "table.csv", "--output", "recordings")
    audited = printed(capsys, "audit", "recordings", "--folds", "folds.csv", "--target", "level")
    main(["train", "recordings", "--folds", "folds.csv", "--output", "run", *RECIPE])
    found = printed(capsys, "evaluate", "recordings", "--folds", "folds.csv", "--no-comparators",
                    *RECIPE)["result"]  # fmt: skip
    main(["bundle", "run", "--output", "pad.taxel"])
    (live,) = printed(
        capsys, "live", "pad.taxel", "replay://recordings/pad-X_test-2.mcap?speed=max"
    )

    assert len(made["recordings"]) == 12
    assert made["notes"][0].endswith("8 trials of 80 scans of 4 channels")
    assert audited
    assert found["scores"]["accuracy"] == 1.0
    assert set(live["answers"]) == {"10"}


@pytest.mark.slow
def test_an_hdf5_file_of_groups_is_trained_on_without_a_choice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A group a trial, its label an attribute; `train` by itself chooses how."""
    monkeypatch.chdir(tmp_path)
    values, levels, sessions = stack(3, 0)
    with h5py.File("pad.h5", "w") as file:
        for number, trial in enumerate(values):
            group = file.create_group(f"data/demo_{number}")
            group.create_dataset("touch", data=trial[: 60 + number], compression="gzip")
            group.attrs["level"] = int(levels[number])
            group["session"] = sessions[number]
    Path("table.csv").write_text(
        "file,trials,axes,label:level,group:session,channels,time\npad.h5,data/*/touch,"
        "rows height width,from:data/*@level,from:data/*/session,*[N],rate:100Hz\n"
    )
    main(["import", "table.csv", "--output", "recordings"])
    main(["train", "recordings", "--output", "run", "--minutes", "0.02"])
    main(["bundle", "run", "--output", "pad.taxel"])
    (live,) = printed(capsys, "live", "pad.taxel", "replay://recordings/pad-demo_1.mcap?speed=max")

    assert set(live["answers"]) == {"10"}


@pytest.mark.parametrize("name", ["pad.npz", "pad.h5"])
def test_a_file_of_arrays_in_the_tables_place_is_named_with_what_it_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused, name: str
) -> None:
    """What to write into the table is then known: names and shapes."""
    monkeypatch.chdir(tmp_path)
    np.savez("pad.npz", X=np.zeros((4, 5, 3), "f4"), y=np.arange(4))
    with h5py.File("pad.h5", "w") as file:
        file["X"], file["y"] = np.zeros((4, 5, 3), "f4"), np.arange(4)

    line = refused(["import", name, "--output", "out"])

    assert "a file of arrays: X (4 × 5 × 3 float32), y (4 int64); write a table" in line


def test_a_label_that_is_an_attribute_of_hdf5_groups_is_answered_with_its_spelling(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    """The list of arrays holds no attributes."""
    monkeypatch.chdir(tmp_path)
    with h5py.File("pad.h5", "w") as file:
        file["trial_1/force"] = np.zeros((5, 3), "f4")
        file["trial_1"].attrs["object"] = "cup"
    line = "pad.h5,trial_*/force,rows channels,from:object,*[N],rate:100Hz\n"
    Path("table.csv").write_text(f"file,trials,axes,label:object,channels,time\n{line}")

    line = refused(["import", "table.csv", "--output", "out"])

    assert "got 'object', where pad.h5 holds trial_1/force (5 × 3 float32);" in line
    assert "write GROUP@NAME, as in from:trial_*@object" in line


def test_a_file_of_matlab_4_is_listed_and_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused, capsys: Any
) -> None:
    """As PhysioNet has them: channels along the first axis, a trial each."""
    from scipy.io import savemat

    monkeypatch.chdir(tmp_path)
    savemat("als1m.mat", {"val": np.arange(40, dtype="i2").reshape(2, 20)}, format="4")
    line = "als1m.mat,channels rows,als,left[raw] right[raw],rate:300Hz\n"
    Path("table.csv").write_text(f"file,axes,label:group,channels,time\n{line}")

    listed = refused(["import", "als1m.mat", "--output", "out"])
    made = printed(capsys, "import", "table.csv", "--output", "out")["recordings"]

    assert "which is a file of arrays: val (2 × 20 int16); write a table" in listed
    values = read_recording(Path(made[0])).samples.values
    np.testing.assert_array_equal(values, np.arange(40).reshape(2, 20).T)


def test_a_file_that_cannot_be_read_says_so_before_a_table_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    """What was needed, and how to mend it."""
    monkeypatch.chdir(tmp_path)
    Path("a.mat").write_bytes(b"hello " * 50)

    line = refused(["import", "a.mat", "--output", "out"])

    assert "got a.mat, which is not one, and cannot be read either: needed a .mat file of" in line
    assert "got another kind of file; save it with save(…, '-v7'); then write a table" in line


def test_without_h5py_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    """In one line, before anything is written."""
    import sys

    monkeypatch.chdir(tmp_path)
    Path("a.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    Path("table.csv").write_text("file,trials,channels,time\na.h5,X,*[N],rate:100Hz\n")
    monkeypatch.setitem(sys.modules, "h5py", None)

    line = refused(["import", "table.csv", "--output", "out"])

    assert "needed the package h5py" in line
    assert "pip install 'taxel[hdf5]'" in line
    assert not Path("out").exists()
    line = refused(["import", "a.h5", "--output", "out"])
    assert "needs the package h5py to be read; pip install 'taxel[hdf5]'; then write" in line


def test_names_of_a_hostile_file_are_shown_literally(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    """Escape sequences and line ends in names of arrays, in each message that lists them."""
    monkeypatch.chdir(tmp_path)
    with h5py.File("a.h5", "w") as file:
        file["\x1b[31mX\ntaxel: all is well"] = np.zeros((4, 5, 3), "f4")
    Path("table.csv").write_text("file,trials,channels,time\na.h5,Z,*[N],rate:100Hz\n")

    for words in (["import", "table.csv"], ["import", "a.h5"]):
        line = refused([*words, "--output", "out"])
        assert "\x1b" not in line
        assert r"\x1b[31mX" in line
