"""A line that is unused leaves out what it names, though another line names the whole of it."""

from pathlib import Path

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadInput, BadSplit, BadTable
from taxel.evaluation.camera_trials import sides as cameras
from taxel.evaluation.fold_table import FoldTable, read_fold_table
from taxel.evaluation.table_split import split_by_table, trials_tested, trials_to_score

RECORDINGS = {f"s{n}" for n in range(6)}
NAMES = [f"t{i}" for i in range(4)]
GROUPS = [{"object": f"o{i // 2}", "file": f"videos/{i}.avi"} for i in range(4)]
HEAD = "recording,side,start_s"


def table(folder: Path, *lines: str, to_score: bool = False) -> FoldTable:
    """Return a table of these lines."""
    path = folder / "folds.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_fold_table(path, to_score=to_score)


def test_a_bad_grasp_is_left_out_of_each_side_of_its_recording(tmp_path: Path) -> None:
    """Of training, validation and test; a line without a start names the whole recording."""
    rows = ("s0,train,", "s1,validation,", "s2,test,", "s0,unused,20.5", "s1,unused,60",
            "s2,unused,170")  # fmt: skip
    split = split_by_table(table(tmp_path, HEAD, *rows), make_dataset(), "shape", RECORDINGS)
    (fold,) = split.folds

    assert fold.train == {0, 1, 3, 4, 5}
    assert fold.validation == {7, 8, 9, 10, 11}
    assert fold.test == {12, 13, 14, 15, 16}
    assert split.notes[0].startswith("21 of 36 trials stand on no side")


def test_the_more_exact_line_holds(tmp_path: Path) -> None:
    """A recording is unused but for a single trial."""
    rows = ("s0,unused,", "s0,train,10", "s1,train,", "s2,test,")
    split = split_by_table(table(tmp_path, HEAD, *rows), make_dataset(), "shape", RECORDINGS)

    assert split.folds[0].train == {1, *range(6, 12)}


def test_a_fold_leaves_out_its_own_lines_alone(tmp_path: Path) -> None:
    rows = ("s0,1,train,", "s1,1,test,", "s0,1,unused,0", "s1,2,train,", "s0,2,test,")
    split = split_by_table(table(tmp_path, "recording,fold,side,start_s", *rows), make_dataset(),
                           "shape", RECORDINGS)  # fmt: skip

    assert [(len(fold.train), len(fold.test)) for fold in split.folds] == [(5, 6), (6, 6)]


def test_bundles_and_runs_are_scored_without_what_is_unused(tmp_path: Path) -> None:
    """Lines that are unused may name what is not there, as those of other sides may."""
    rows = (HEAD, "s0,test,", "s0,unused,30", "elsewhere,unused,", "away,train,")
    to_score = table(tmp_path, *rows, to_score=True)
    trials = make_dataset().trials

    assert trials_to_score(to_score, trials, RECORDINGS) == {0, 1, 2, 4, 5}
    assert trials_tested(to_score, trials, RECORDINGS) == {0, 1, 2, 4, 5}
    starts = [f"s0,unused,{10 * n}" for n in range(6)]
    with pytest.raises(BadSplit, match=r"leaves out as unused; mend"):
        trials_to_score(table(tmp_path, HEAD, "s0,test,", *starts, to_score=True), trials,
                        RECORDINGS)  # fmt: skip


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ((HEAD, "s0,train,", "s1,test,", "s0.mcap,unused,"),
         "got 's0' as unused in folds.csv, line 4, and as train in line 2"),
        ((HEAD, "s0,unused,10", "s0,test,10", "s1,train,"),
         "got 's0' as test in folds.csv, line 3, and as unused in line 2"),
        (("group:session,side", "s0,train", "s1,test", "s1,unused"), "got 's1' as unused in"),
        ((HEAD, "s0,unused,10", "s0,test,12.5", "s1,train,"),
         "got s0#1 as test in folds.csv, line 3, and as unused in another"),
        ((HEAD, "s0,train,", "s1,test,", *(f"s1,unused,{60 + 10 * n}" for n in range(6))),
         "a side whose trials folds.csv leaves out as unused"),
    ],
)  # fmt: skip
def test_a_line_that_contradicts_another_is_refused(
    tmp_path: Path, lines: tuple[str, ...], message: str
) -> None:
    """The very same thing, by any spelling, cannot be unused and on a side."""
    with pytest.raises(BadInput) as error:
        split_by_table(table(tmp_path, *lines), make_dataset(), "shape", RECORDINGS)

    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_camera_trials_cannot_be_unused_under_another_name(tmp_path: Path) -> None:
    """A trial's name and its file's are the same trial."""
    rows = ("recording,side", "t0,train", "t1,test", "t2,train", "t3,unused", "0,unused")
    path = tmp_path / "folds.csv"
    table(tmp_path, *rows)
    message = r"t0 as train in folds\.csv, line 2, and as unused in another"

    with pytest.raises(BadSplit, match=message):
        cameras.split_by_table(NAMES, GROUPS, np.array([0, 1, 1, 0]), path)
    with pytest.raises(BadSplit, match=message):
        cameras.trials_to_score(NAMES, GROUPS, read_fold_table(path, to_score=True))
    with pytest.raises(BadTable, match=r"as unused in folds\.csv, line 4, and as test in line 3"):
        table(tmp_path, "recording,side", "t0,train", "t1,test", "t1,unused")
