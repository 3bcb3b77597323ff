"""Sides of camera trials: what stands on both is said, and a class of one trial is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from trial_makers import write_trials

from taxel.cli.options.trials import TrialOptions
from taxel.errors import BadDataset, BadSplit, BadTable
from taxel.evaluation.camera_trials.sides import (
    left_out,
    order_of,
    shared_values,
    split_by_table,
    split_trials,
    trials_to_score,
)
from taxel.evaluation.camera_trials.trial_set import load_trial_set
from taxel.evaluation.fold_table import read_fold_table
from taxel.windows.camera_trials import read_camera_trials

GROUPS = [{"object": f"o{i // 4}", "file": f"{i}.avi"} for i in range(16)]
Y = np.arange(16) % 2


def test_objects_on_both_sides_are_counted(tmp_path: Path) -> None:
    """By a column, at random or by a table; not where objects are held out."""
    column = [{**own, "split": "test" if i in (0, 1, 5) else "train"}
              for i, own in enumerate(GROUPS)]  # fmt: skip
    table = tmp_path / "folds.csv"
    table.write_text("recording,side\nt0,test\nt1,test\nt2,train\nt3,train\n")
    names = [f"t{i}" for i in range(16)]

    note = shared_values(split_trials(column, Y, None, 5, 0), column, Y)
    assert note is not None
    assert note.startswith("2 of 2 tested objects are on both sides")
    note = shared_values(split_trials(GROUPS, Y, "random", 4, 0), GROUPS, Y)
    assert note is not None
    assert note.startswith("4 of 4 tested objects")
    note = shared_values(split_by_table(names, GROUPS, Y, table), GROUPS, Y)
    assert note is not None
    assert note.startswith("1 of 1 tested object is on both sides")
    assert shared_values(split_trials(GROUPS, Y, "group:object", 4, 0), GROUPS, Y) is None


@pytest.mark.parametrize(
    ("y", "text", "got", "mend"),
    [
        ([0, 1] * 7 + [0, 2], "random", "1 of 'slpi'", "if it is mistyped"),
        ([0, 1] * 7 + [0, 2], "group:object", "1 of 'slpi'", "if it is mistyped"),
        ([0, 1] * 6 + [0, 2, 2, 2], "random", "3 trials of 'slpi', the rarest",
         "--fold-count of at most 3"),
        ([0, 1] * 6 + [2, 2, 2, 2], "group:object", "all 4 trials of 'slpi' in one",
         "record it in another object too, or hold out something else"),
        ([0, 0, 1, 1, 1, 1, 0, 0, 0, 2, 2, 1, 2, 0, 0, 1], "group:object",
         "3 trials of 'slpi', the rarest in 2 objects", "--fold-count of at most 3"),
    ],
)  # fmt: skip
def test_a_rare_class_is_named_with_its_trials(
    y: list[int], text: str, got: str, mend: str
) -> None:
    """Without a group nothing is said of groups; the option is called as it is."""
    with pytest.raises(BadSplit) as error:
        split_trials(GROUPS, np.array(y), text, 4, 0, ("hold", "slip", "slpi"))

    assert error.value.got == got
    assert mend in error.value.mend
    assert "--folds" not in str(error.value)


@pytest.mark.parametrize(
    ("rows", "kind", "got"),
    [
        ("group:object,fold\no0,1\no1,2\n", BadTable, "2 folds in folds.csv"),
        ("recording,side\nt0,train\nt99,test\n", BadSplit, "'t99' in folds.csv, line 3"),
        ("group:object,side\no0,test\no0,validation\n\no1,train\n", BadSplit, "4 on both sides"),
    ],
)
def test_a_table_that_cannot_score_a_bundle_is_refused(
    rows: str, kind: type[Exception], got: str, tmp_path: Path
) -> None:
    table = tmp_path / "folds.csv"
    table.write_text(rows)

    with pytest.raises(kind, match=got):
        trials_to_score([f"t{i}" for i in range(16)], GROUPS, read_fold_table(table, to_score=True))


def test_only_the_test_part_is_scored_though_the_training_part_is_elsewhere(tmp_path: Path) -> None:
    table = tmp_path / "folds.csv"
    table.write_text("group:object,side\nelsewhere,train\no3,test\no1,test\n")

    found = trials_to_score(
        [f"t{i}" for i in range(16)], GROUPS, read_fold_table(table, to_score=True)
    )
    assert found == [4, 5, 6, 7, 12, 13, 14, 15]

    table.write_text("group:object,side\no3,test\n")
    alone = read_fold_table(table, to_score=True)
    assert trials_to_score([f"t{i}" for i in range(16)], GROUPS, alone) == [12, 13, 14, 15]


def test_trials_that_a_table_does_not_name_are_counted(tmp_path: Path) -> None:
    """They are neither trained on nor tested, which the accuracy does not show."""
    table, names = tmp_path / "folds.csv", [f"t{i}" for i in range(16)]
    table.write_text("group:object,side\no0,train\no1,train\no2,test\n")
    some = split_by_table(names, GROUPS, Y, table)
    assert left_out(some, 16) == "4 of 16 trials stand on no side of folds of folds.csv: left out"
    table.write_text(table.read_text() + "o3,test\n")
    assert left_out(split_by_table(names, GROUPS, Y, table), 16) is None


def test_a_tested_class_that_was_never_trained_on_is_named() -> None:
    """As with --test and a mistyped label; the rest of the message is no use without it."""
    y, groups = np.array([0, 1] * 7 + [0, 2]), [dict(own) for own in GROUPS]
    for at, own in enumerate(groups):
        own["split"] = "test" if at >= 12 else "train"
    with pytest.raises(BadSplit, match=r"none of 'slpi' there, 1 to test; train on some of them"):
        split_trials(groups, y, None, 4, 0, ("hold", "slip", "slpi"))


def test_a_class_that_a_table_does_not_train_on_is_named(tmp_path: Path) -> None:
    table, names = tmp_path / "folds.csv", [f"t{i}" for i in range(16)]
    table.write_text("group:object,side\no0,train\no1,train\no2,train\no3,test\n")
    y = np.array([0, 1] * 6 + [0, 1, 2, 2])
    with pytest.raises(BadSplit, match=r"training side of test; got none of 'slpi' there; name"):
        split_by_table(names, GROUPS, y, table, ("hold", "slip", "slpi"))


def test_a_trial_that_a_table_tests_twice_is_refused(tmp_path: Path) -> None:
    """Its first answer would be overwritten by that of the second repetition."""
    table = tmp_path / "folds.csv"
    table.write_text(
        "group:object,fold,side\no0,1,train\no1,1,train\no2,1,test\n"
        "o1,2,train\no3,2,train\no2,2,test\n"
    )

    with pytest.raises(BadSplit, match=r"t8 in 2 of folds\.csv"):
        split_by_table([f"t{i}" for i in range(16)], GROUPS, Y, table)


def test_trials_of_unlike_rates_are_refused_and_twins_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A crop is so many frames: at other rates another time. Twins across a split are a leak."""
    table = write_trials(tmp_path, objects=2, each=2, frames=12)
    head, *lines = table.read_text().splitlines()
    rates = (25, 25, 25, 10)
    table.write_text("\n".join([f"{head},rate", *(f"{line},{rate}" for line, rate in
                                                  zip(lines, rates, strict=True))]))  # fmt: skip
    with pytest.raises(BadDataset, match=r"10 frames/s in 0004.* and 25 in 0001"):
        load_trial_set(read_camera_trials(table), None, tmp_path / "cache")
    stills = [
        replace(trial, frames=1) for trial in read_camera_trials(table)
    ]  # images have no rate
    assert load_trial_set(stills, None, tmp_path / "cache").layout.crop == 1
    table.write_text("\n".join([head, *lines, lines[1].replace("o1", "o9"), lines[2]]))
    TrialOptions()._read(table)
    message = capsys.readouterr().err
    assert "warning: the same images in 0002-" in message
    assert "and 0005-" in message
    assert "and in 1 more such set: where a split parts them" in message


def test_later_trials_are_known_by_numbers_whoever_names_the_test_side() -> None:
    """A split by order, or a column: the tested numbers are the larger ones in each class."""
    y = np.arange(24) % 3
    takes = np.arange(24) // 3
    groups = [{"take": str(take), "object": f"o{take % 2}",
               "split": "test" if take > 5 else "train"} for take in takes]  # fmt: skip
    for text in ("order:take:5", "split", "order:take:70%"):
        split = split_trials(groups, y, text, 5, 0)
        found = order_of(split, groups, y)
        assert found is not None
        assert found.tolist() == takes.tolist()
    by_object = split_trials(groups, y, "group:object", 2, 0)
    assert order_of(by_object, groups, y) is None
    shuffled = [own | {"take": str((7 * at) % 24)} for at, own in enumerate(groups)]
    assert order_of(split_trials(shuffled, y, "split", 5, 0), shuffled, y) is None
    lacking = [own if at else {"object": "o0", "split": "train"} for at, own in enumerate(groups)]
    assert order_of(split_trials(lacking, y, "split", 5, 0), lacking, y) is None
