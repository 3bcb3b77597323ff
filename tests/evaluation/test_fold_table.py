"""Somebody else's split: whole trials only, and each mistake in the table is one plain line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.bundles.contract import value_fingerprint
from taxel.errors import BadInput, BadSplit, BadTable
from taxel.evaluation.fold_table import FoldTable, read_fold_table
from taxel.evaluation.shared_values import name_by_unseen, named_by_unseen
from taxel.evaluation.splits import Split, TrialFold
from taxel.evaluation.table_split import split_by_table, trials_to_score
from taxel.labels.trials import coarsest_group, lone_group
from taxel.windows.dataset import Dataset, only_labelled

RECORDINGS = {f"s{n}" for n in range(6)} | {"too-short"}


def table(folder: Path, *lines: str) -> FoldTable:
    """Return a table of these lines."""
    path = folder / "folds.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_fold_table(path)


def split(folder: Path, *lines: str, dataset: Dataset | None = None) -> Split:
    """Return the split that these lines name."""
    return split_by_table(table(folder, *lines), dataset or make_dataset(), "shape", RECORDINGS)


SIDED = ("recording,side", "s0,train", "s1.mcap,train", "s2,Validation", "s3,test", "s4,unused")


def test_train_validation_and_test_are_kept_apart(tmp_path: Path) -> None:
    """Each recording's windows stand on the side that its row says, the others on none."""
    dataset = make_dataset()
    found = split(tmp_path, *SIDED, dataset=dataset)
    (fold,) = found.folds
    session = dataset.group("session")[dataset.trial]
    train, test = fold.windows(dataset)

    assert found.name == "folds.csv"
    assert set(session[train]) == {"s0", "s1"}
    assert set(session[test]) == {"s3"}
    assert set(session[fold.validation_windows(dataset)]) == {"s2"}


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_table_from_a_spreadsheet_is_the_same(
    tmp_path: Path, separator: str, encoding: str
) -> None:
    """Semicolons where the comma is a decimal one, as in an import table; a mark at the start."""
    known = table(tmp_path, *SIDED)
    text = "\r\n".join((SIDED[0] + ",,", *SIDED[1:], ",,,")).replace(",", separator)
    (tmp_path / "folds.csv").write_bytes(text.encode(encoding))

    assert repr(read_fold_table(tmp_path / "folds.csv")) == repr(known)  # NaN is no NaN


def test_folds_by_name_test_every_recording_once(tmp_path: Path) -> None:
    """With the column fold alone, what is not tested is trained on."""
    lines = [f"s{n},{'ab'[n % 2]}" for n in range(6)]
    dataset = make_dataset()
    found = split(tmp_path, "recording,fold", *lines, dataset=dataset)
    tested = np.concatenate([fold.windows(dataset)[1] for fold in found.folds])

    assert [fold.name for fold in found.folds] == ["fold a", "fold b"]
    np.testing.assert_array_equal(np.sort(tested), np.arange(len(dataset)))


def test_folds_may_say_their_sides_themselves(tmp_path: Path) -> None:
    """With fold and side, a recording has a line in each fold that it takes part in."""
    found = split(tmp_path, "recording,fold,side", "s0,1,train", "s1,1,val", "s2,1,test",
                  "s1,2,train", "s0,2,test")  # fmt: skip

    assert [(len(f.train), len(f.validation), len(f.test)) for f in found.folds] == [
        (6, 6, 6), (6, 0, 6)
    ]  # fmt: skip


def test_groups_and_single_trials_can_be_named(tmp_path: Path) -> None:
    """All trials of a session by one row, and a trial of many by its start."""
    found = split(tmp_path, "group:session,side", "s0,train", "s5,test")
    assert len(found.folds[0].train) == 6

    rows = [f"s0,{10.0 * n},{'train' if n < 3 else 'test'}" for n in range(6)]
    found = split(tmp_path, "recording,start_s,side", *rows)
    assert found.folds[0].train == {0, 1, 2}
    assert found.folds[0].test == {3, 4, 5}


SPANS = {f"s{n}": (60.0 * n, 60.0 * n + 55.0) for n in range(6)}
STARTS = ("recording,start_s,side", "s0,0,train", "s0,10,train", "s1,60,test")


def test_a_moment_outside_its_recording_is_refused(tmp_path: Path) -> None:
    """On whatever side, by line; the figures differ however close it is."""
    dataset = replace(make_dataset(), spans=SPANS)
    cases = {
        "s0,9999,train": "within 0 and 55 s, as s0 lasts; got 9999 s in folds.csv, line 5",
        "s0,55.01,unused": "got 55.01 s in folds.csv, line 5; give start_s on the recording's own",
        "s1,59.99,test": "within 60 and 115 s, as s1 lasts; got 59.99 s",
    }
    for row, message in cases.items():
        with pytest.raises(BadTable) as error:
            split(tmp_path, *STARTS, row, dataset=dataset)
        assert message in str(error.value)
        assert "\n" not in str(error.value)


def test_moments_between_trials_and_trials_without_a_row_are_noted(tmp_path: Path) -> None:
    """A moment in a trial that gave no window, or lacks the label, is no such moment."""
    dataset = replace(make_dataset(), spans=SPANS)
    empty = replace(dataset.trials[0], start_s=7.0, end_s=9.0)
    found = split(tmp_path, *STARTS, "s0,7,train", "s0,17,train", "s1,67,test",
                  dataset=replace(dataset, empty=(empty,)))  # fmt: skip

    assert found.notes == (
        "33 of 36 trials stand on no side of folds.csv: left out",
        "2 of 6 rows of folds.csv begin in no trial, such as line 6: left out",
    )
    assert split(tmp_path, *SIDED, "s5,train").notes == (
        "6 of 36 trials stand on no side of folds.csv: left out",)  # fmt: skip


@pytest.mark.parametrize("why", ["unlabelled", "empty"])
def test_a_moment_in_a_trial_that_is_left_out_moves_no_neighbour(tmp_path: Path, why: str) -> None:
    """Less than a millisecond behind a trial's last row, where tables round."""
    dataset = make_dataset()
    first = dataset.trials[0]
    start = first.end_s + 0.0004
    behind = replace(first, start_s=start, end_s=start + 2.0,
                     labels={} if why == "unlabelled" else first.labels)  # fmt: skip
    lines = ("recording,start_s,side", "s0,0,test", "s1,,train", f"s0,{start:.4f},train")
    (fold,) = split(tmp_path, *lines, dataset=replace(dataset, **{why: (behind,)})).folds
    assert (fold.train, fold.test) == (set(range(6, 12)), {0})
    with pytest.raises(BadSplit, match="on two sides"):  # where no other trial is that near
        split(tmp_path, *lines, dataset=dataset)


def test_a_recording_that_gave_no_window_is_no_error(tmp_path: Path) -> None:
    """The table may name recordings that are too short for the window."""
    known = split(tmp_path, *SIDED).folds
    assert split(tmp_path, *SIDED, "too-short,train").folds == known


@pytest.mark.parametrize(
    ("lines", "needed"),
    [
        (("recording,side", "s0,train", "s9,test"), "a recording of the folder; got 's9' in "
         "folds.csv, line 3"),
        (("group:session,side", "s0,train", "x,test"), "a value of the group 'session'"),
        (("group:colour,side", "s0,train", "x,test"), "no such group"),
        (("recording,side", "s0,train", "s0,test"), "each trial on one side; got s0#0 on two"),
        (("recording,side", "s0,train", "s1,validation"), "nothing to test"),
        (("recording,side", "s0,val", "s1,test"), "nothing to train on"),
        (("recording,side", "s0,train", "too-short,test"), "windows to test"),
        (("recording,side", "s0,tarin", "s1,test"), "train, validation, test or unused; got "
         "'tarin' in folds.csv, line 2"),
        (("recording,fold,side", "s0,1,train", "s1,1,test", "s0,2,train", "s1,2,test"),
         "each trial tested in one fold"),
        (("recording,fold", "s0,1", "s1,1"), "at least two folds"),
        (("recording,start_s,side", "s0,now,train", "s1,,test"), "seconds in start_s"),
        (("recording", "s0"), "the columns recording (or group:KEY), fold or side"),
        (("recording:side", "s0:train"), "between commas, semicolons or tabs"),
        (("recording;start_s;side", "s0;0,5;train"), "seconds in start_s, such as 12.5; got '0,5'"),
        (("recording,side,side", "s0,test,train", "s1,train,test"),
         "each column once; got 'side' in the columns 2 and 3 of"),
        (("recording,recording,side", "s0,s1,test"), "'recording' in the columns 1 and 2"),
        (("recording,side", "s0,train", "", "s1,0,test"),
         "got 'test' in column 3 of folds.csv, line 4; mend the line"),
        (("side,group:session", "train,s0", "test,a, b"), "between quotes"),
        (("recording,side", "s0,train", "", "s1,tset"), "'tset' in folds.csv, line 4"),
        (("recording,side",), "at least one row"),
        (("recording,side", ",train"), "a value of recording in every row"),
    ],
)  # fmt: skip
def test_each_mistake_is_one_plain_line(
    tmp_path: Path, lines: tuple[str, ...], needed: str
) -> None:
    """What was needed, what was got and where, and how to mend it."""
    with pytest.raises(BadInput) as error:
        split(tmp_path, *lines)

    assert isinstance(error.value, BadSplit | BadTable)
    assert needed in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("lines", "needed"),
    [
        (("recording,fold", "s0,a"), "a column side in a table for a bundle; got the fold a only"),
        (("recording,side", "s0,train"), "rows with the side test; got train in"),
        (("recording,fold", "s0,a", "s1,b"), "with test in each row to score"),
        (("recording,fold,side", "s0,a,test", "s1,b,test"), "got 2 folds in folds.csv"),
    ],
)
def test_a_table_for_a_bundle_needs_one_test_part_alone(
    tmp_path: Path, lines: tuple[str, ...], needed: str
) -> None:
    """Rows to train on need not be there; each refusal advises what is then accepted."""
    path = tmp_path / "folds.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(BadTable) as error:
        read_fold_table(path, to_score=True)
    assert needed in str(error.value)

    path.write_text("recording,side\ns0,test\n")
    table = read_fold_table(path, to_score=True)
    assert trials_to_score(table, make_dataset().trials, RECORDINGS) == set(range(6))


def unlabelled(dataset: Dataset, *sessions: str) -> Dataset:
    """Return the data set whose trials of these sessions lack the label, as training takes it."""
    trials = tuple(replace(t, labels={}) if t.groups["session"] in sessions else t
                   for t in dataset.trials)  # fmt: skip
    return only_labelled(replace(dataset, trials=trials), "shape", Path("folder"))


def test_a_side_whose_trials_lack_the_label_says_so(tmp_path: Path) -> None:
    """By recording or by session; beside trials that gave no window, both are said."""
    part = unlabelled(make_dataset(), "s3")
    for lines in (SIDED, ("group:session,side", "s0,train", "s1,train", "s3,test")):
        with pytest.raises(BadSplit) as error:
            split(tmp_path, *lines, dataset=part)
        assert "windows to test in test; got none" in str(error.value)
        assert "name trials that lack the label 'shape'; label the recordings" in str(error.value)
    with pytest.raises(BadSplit, match="lack the label 'shape' or gave no window; label the"):
        split(tmp_path, *SIDED, "too-short,test", dataset=part)


def test_a_session_without_the_label_is_left_out_beside_others(tmp_path: Path) -> None:
    """A row may name it, on whatever side; one that is nowhere is refused still."""
    part = unlabelled(make_dataset(), "s3")
    rows = ("group:session,side", "s0,train", "s1,train", "s2,test", "s3,test")
    (fold,) = split(tmp_path, *rows, dataset=part).folds
    assert {part.trials[i].groups["session"] for i in fold.test} == {"s2"}
    with pytest.raises(BadTable, match=r"s3, s4, s5\).*correct it, or leave the row out"):
        split(tmp_path, *rows, "s9,test", dataset=part)


def test_a_class_that_is_tested_must_be_trained(tmp_path: Path) -> None:
    """With a class a session, a test session's class may be one that nobody learned."""
    dataset = make_dataset(one_session_a_class=True)

    with pytest.raises(BadSplit, match=r"every tested class.*none of c2"):
        split(tmp_path, "recording,side", "s0,train", "s1,train", "s2,test", dataset=dataset)


@pytest.mark.parametrize(("lines", "message"), [
    (("group:shape,side", "cube,train", "x,test"), "import again with it as group:shape, too"),
    (("group:trial,side", "1,train", "2,test"), "import them as group:trial_number"),
    (("session,side", "s0,train"), r"tabs: group:session if session is a group\."),
    (("group:trial,side", "1,train", "2,test"), r"and \d+ more\); got '1'"),
])  # fmt: skip
def test_what_people_write_instead_is_answered_with_what_to_write(
    tmp_path: Path, lines: tuple[str, ...], message: str
) -> None:
    with pytest.raises(BadTable, match=message) as caught:
        split(tmp_path, *lines)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(("tested", "drawn"), [("cup0 cup3", "object"), ("cup3", "object"),
                                               ("", "recording")])  # fmt: skip
def test_objects_that_are_tested_unseen_are_drawn_as_a_whole(tested: str, drawn: str) -> None:
    """Nobody named them, as where they lie in a folder of their own: with 6 of 36 trials each, an
    interval over recordings would be too narrow. Objects on both sides are not held out."""
    trials = [
        replace(trial, recording=f"{n}.mcap",
                groups={"recording": str(n), "trial": f"{n}#0", "object": f"cup{n % 6}"})
        for n, trial in enumerate(make_dataset().trials)
    ]  # fmt: skip
    test = {n for n in range(36) if f"cup{n % 6}" in tested.split()} or {0, 1}
    fold = TrialFold("test", frozenset(range(36)) - test, frozenset(test))
    split = named_by_unseen(Split("trained elsewhere", (fold,), None), trials)

    assert coarsest_group(trials, split.name) == drawn
    assert split.name.endswith(", object held out") is (drawn == "object")


def test_sessions_of_one_new_person_say_nothing_about_other_persons() -> None:
    """Three sessions are drawn, but the interval is one over sessions of this person."""
    trials = [
        replace(trial, groups=trial.groups | {"person": "B" if trial.groups["session"] > "s2"
                                              else "A"})
        for trial in make_dataset().trials
    ]  # fmt: skip
    test = {n for n, trial in enumerate(trials) if trial.groups["person"] == "B"}
    fold = TrialFold("test", frozenset(range(len(trials))) - test, frozenset(test))
    name = named_by_unseen(Split("trained elsewhere", (fold,), None), trials).name
    tested = [trials[n] for n in sorted(test)]

    assert coarsest_group(tested, name) == "session"
    assert lone_group(tested, name) == "person"


def test_recognisers_are_tested_on_unseen_objects_where_each_says_what_it_was_trained_on() -> None:
    """Of a bundle of before, nothing is known of its objects; of two runs both must lack them."""
    tested = [
        replace(trial, groups={"recording": str(n), "trial": f"{n}#0", "object": f"cup{n % 3}"})
        for n, trial in enumerate(make_dataset().trials)
    ]
    other, same = ({"object": (value_fingerprint(name),)} for name in ("cup9", "cup2"))

    assert name_by_unseen("", tested, [other, other]).endswith(", object held out")
    assert name_by_unseen("", tested, [other, same]) == ""
    assert name_by_unseen("", tested, [{}]) == ""


def test_a_table_of_recordings_names_the_sessions_that_it_holds_out(tmp_path: Path) -> None:
    """The coarsest of what is unseen, once; a table of sessions names them already."""
    trials = make_dataset().trials
    rows = [f"s{n},{'test' if n > 3 else 'train'}" for n in range(6)]
    names = [
        named_by_unseen(split(tmp_path, head, *rows), trials).name
        for head in ("recording,side", "group:session,side")
    ]

    assert names == ["folds.csv, session held out"] * 2
