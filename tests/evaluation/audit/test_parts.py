"""The audit's parts: statistics against known results, tables of folds, copies, reading."""

import csv
import os
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from taxel.errors import BadDataset, BadSplit, BadTable
from taxel.evaluation.audit.audit import audit
from taxel.evaluation.audit.copies import near_copies, same_rows
from taxel.evaluation.audit.evidence import _auc, deal_out, evidence_of, gap_p, look_up, trial_folds
from taxel.evaluation.audit.finding import holm
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.sides import table_sides
from taxel.evaluation.audit.touch_set import TouchSet, checked, honest_key
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.simulated.data_sets import write_sessions

Make = dict[str, Callable[..., TouchSet]]


def test_holm_gives_the_textbook_values() -> None:
    """0.01, 0.04, 0.03 of three tests become 0.03, 0.06, 0.06."""
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])


def test_the_area_is_that_of_the_library() -> None:
    """With ties, too."""
    rng = np.random.default_rng(0)
    label, score = rng.integers(0, 2, 50), rng.integers(0, 9, 50) / 9.0

    assert _auc(label[None], score)[0] == pytest.approx(roc_auc_score(label, score))


def dealt(label: np.ndarray, groups: np.ndarray | None, draws: int) -> np.ndarray:
    """Return labels dealt out anew, shape (draws, trials)."""
    found = np.full((draws, len(label)), -1, np.intp)
    for part, trials, drawn in deal_out(label, groups, draws, 0):
        found[part, trials] = drawn
    return found


def dealt_at_once(label: np.ndarray, groups: np.ndarray | None, draws: int) -> np.ndarray:
    """The same in plain words, with all draws in memory."""
    rng = np.random.default_rng(0)
    if groups is None:
        return rng.permuted(np.tile(label, (draws, 1)), axis=1)
    names, index = np.unique(groups, return_inverse=True)
    members = [np.flatnonzero(index == number) for number in range(len(names))]
    mixed = [own for own in members if len(set(label[own])) > 1]
    if sum(map(len, mixed)) >= len(label) / 2:
        drawn = np.tile(label, (draws, 1))
        for own in mixed:
            drawn[:, own] = rng.permuted(drawn[:, own], axis=1)
        return drawn
    of_group = np.array([np.bincount(label[own]).argmax() for own in members])
    return rng.permuted(np.tile(of_group, (draws, 1)), axis=1)[:, index]


@pytest.mark.parametrize("way", ["no groups", "mixed groups", "some mixed", "groups of one class"])
def test_labels_dealt_out_in_blocks_are_those_dealt_out_at_once(way: str) -> None:
    """730 draws: seven blocks of 100 and a rest."""
    label = np.array([0, 1, 2] * 20, np.intp)
    groups: np.ndarray | None = np.repeat(np.array(list("abcdef")), 10)
    if way == "no groups":
        groups = None
    elif way == "some mixed":
        label[:20] = 1
    elif way == "groups of one class":
        label = np.repeat(np.array([0, 1, 2, 0, 1, 2], np.intp), 10)

    np.testing.assert_array_equal(dealt(label, groups, 730), dealt_at_once(label, groups, 730))


def test_many_trials_take_little_memory() -> None:
    """The draws of these tests, 1999, of 4,000 trials are 64 MB at once."""
    y = np.arange(4000) % 2
    folds = [(np.flatnonzero(y >= 0), np.flatnonzero(y >= 0))]
    probability = np.random.default_rng(0).dirichlet((1.0, 1.0), 4000)
    groups = np.repeat(np.arange(8).astype(str), 500)
    tracemalloc.start()
    for own in (None, groups):
        evidence_of(probability, y, np.arange(4000), own, folds)
    gap_p(probability[:, 0] - 0.5)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()

    assert most < 30e6


def test_labels_are_dealt_out_within_groups_of_several_classes() -> None:
    """Each group keeps its own number of each class."""
    label = np.array([0, 1, 1, 0, 0, 1], np.intp)
    groups = np.array(["a", "a", "a", "b", "b", "b"])

    drawn = dealt(label, groups, 50)

    assert (drawn[:, :3].sum(axis=1) == 2).all()
    assert (drawn[:, 3:].sum(axis=1) == 1).all()
    assert len({tuple(row) for row in drawn}) > 4


def test_whole_groups_of_one_class_swap_labels() -> None:
    """All trials of a group stay alike."""
    groups = np.repeat(np.array(list("abcdef")), 3)
    label = np.repeat(np.array([0, 1, 0, 1, 0, 1], np.intp), 3)

    drawn = dealt(label, groups, 30)

    assert all(len(set(row[i : i + 3])) == 1 for row in drawn for i in range(0, 18, 3))


def test_a_name_that_training_never_saw_predicts_nothing() -> None:
    """With whole sessions held out, the session's name gives no more than the majority."""
    y = np.repeat(np.array([0, 1, 0, 1, 0, 1], np.intp), 5)
    names = np.repeat(np.array(list("abcdef")), 5)
    apart, mixed = trial_folds(y, names, 0), trial_folds(y, None, 0)

    unseen = evidence_of(look_up(names, y, apart), y, np.arange(30), names, apart)
    seen = evidence_of(look_up(names, y, mixed), y, np.arange(30), None, mixed)

    assert unseen.accuracy <= unseen.majority
    assert not unseen.counts(unseen.p)
    assert seen.accuracy == 1.0
    assert seen.counts(seen.p)


def test_a_gap_in_every_unit_is_sure_and_none_is_not() -> None:
    """Twenty units that all gain have a small p; gains that cancel have a large one."""
    assert gap_p(np.full(20, 0.1)) < 0.001
    assert gap_p(np.tile([0.1, -0.1], 10)) > 0.3


def test_two_sessions_a_class_are_too_few_to_hold_out(make_set: Make) -> None:
    """Where each session holds one class, eight of them at least allow a statement."""
    touch = make_set["array"]()
    few = _regrouped(touch, [f"{c}-{i % 2}" for i, c in enumerate(touch.y)])
    enough = _regrouped(touch, [f"{c}-{i % 4}" for i, c in enumerate(touch.y)])

    assert honest_key(few) != "session"
    assert honest_key(enough) == "session"


def test_a_copy_that_starts_elsewhere_is_still_a_copy(make_set: Make) -> None:
    """A trial whose second half is another's first half shares its rows."""
    touch = make_set["array"]()
    rows = list(touch.rows)
    rows[7] = np.concatenate([rows[7][:20], rows[3][:20]])

    assert set(same_rows(replace(touch, rows=tuple(rows)))) == {(3, 7)}


def test_honest_trials_are_no_copies_of_each_other(system: TouchSet) -> None:
    """Trials of one class, object and session are alike, but not that much."""
    assert same_rows(system) == {}
    assert near_copies(system, {}) == ({}, {}, {})


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.05])
def test_a_rescaled_copy_with_noise_is_told_from_its_neighbours(
    system: TouchSet, noise: float
) -> None:
    """Noise of up to a twentieth of each channel's deviation does not hide it."""
    rng = np.random.default_rng(0)
    rows = list(system.rows)
    rows[1] = 0.7 * rows[0] + 3.0 + noise * rows[0].std(axis=0) * rng.normal(size=rows[0].shape)
    rows[1] = rows[1].astype(np.float32)

    straight, _, turned = near_copies(replace(system, rows=tuple(rows)), {})

    assert set(straight) == {(0, 1)}
    assert not turned


def test_a_table_may_name_whole_recordings_trials_and_windows(
    make_set: Make, tmp_path: Path
) -> None:
    """No start: all of it; the trial's start: the trial; another: one window, or up to end_s."""
    touch = make_set["array"]()
    lines = ["r00,,,train", "r01.mcap,0,,train", "r02,0.5,,test", "r03,0.5,1.0,test"]
    table = _table(tmp_path, "recording,start_s,end_s,side", *lines)

    pieces, sides = table_sides(touch, table, steps=8)

    assert (pieces.stop - pieces.first).tolist() == [40, 40, 8, 11]
    assert [part.tolist() for part in sides.folds[0]] == [[0, 1], [2, 3]]


def test_a_trial_that_a_table_leaves_out_is_not_audited(make_set: Make, tmp_path: Path) -> None:
    """Beside a line for the whole recording; windows of it stand as they were named."""
    touch = make_set["array"]()
    lines = [
        "r00,,train",
        "r01,,train",
        "r02,,test",
        "r03,0.5,test",
        "r00,0,unused",
        "r03,0,unused",
    ]
    table = _table(tmp_path, "recording,start_s,side", *lines)

    _, sides = table_sides(touch, table, steps=8)

    assert [part.tolist() for part in sides.folds[0]] == [[1], [2, 3]]
    with pytest.raises(BadSplit, match="to test in test"):
        table_sides(touch, _table(tmp_path, "recording,start_s,side", "r00,,train", "r01,,test",
                                  "r01,0,unused"), steps=8)  # fmt: skip


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["recording,fold", "nothere,1", "r01,2"], "'nothere'"),
        (["recording,fold,side", "r00,1,test"], "of fold '1'"),
        (["recording,side", "r00,train", "r01,tset"], "line 3"),
        (["recording,colour", "r00,red"], "line 1"),
        (["recording,fold"], "at least one row"),
        (["recording,fold", "r00,1", "r01,1"], "two folds"),
        (["recording,side", "r00,train", "r01,train"], "train and test"),
        (["recording,start_s,side", "r00,soon,train"], "seconds"),
        (["recording,start_s,side", "r00,99,train", "r01,,test"], "labelled trial"),
    ],
)
def test_a_bad_table_is_refused_with_its_line(
    make_set: Make, tmp_path: Path, lines: list[str], message: str
) -> None:
    """The message says what was needed and where."""
    with pytest.raises(BadTable, match=message):
        table_sides(make_set["array"](), _table(tmp_path, *lines), steps=8)


def test_recordings_of_an_array_are_read_as_trials(tmp_path: Path) -> None:
    """Each grasp of a simulated session is one trial; the first label is taken and said."""
    config = TengHandConfig(sessions=2, rate_hz=100.0, scans_per_class=3000)
    write_sessions(tmp_path / "hand", config, lambda _: None)
    seen = []

    touch = read_touch(tmp_path / "hand", None, lambda *step: seen.append(step))

    assert touch.kind == "array"
    assert touch.target == "material"
    assert "shape" in touch.notes[0]
    assert touch.rows[0].shape[1] == 12
    assert seen[-1] == ("recordings", 2, 2)
    with pytest.raises(BadDataset, match="'colour'"):
        read_touch(tmp_path / "hand", "colour", lambda *_: None)


def test_recordings_of_cameras_are_read_as_small_squares(few_pours: Path) -> None:
    """Two cameras of 6 × 8 squares; too few pours to audit are refused in one line."""
    with pytest.raises(BadDataset, match="at least 8 trials"):
        read_touch(few_pours, None, lambda *_: None)


DATA = Path(os.environ.get("TAXEL_DATA", Path(__file__).parents[3] / "../shared/data"))


@pytest.mark.real
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind"),
    [("gelsight-slip", "length"), ("icub-grasp", "first frame"), ("teng-glove", "window leak")],
)
def test_a_real_set_s_known_leak_is_found_without_a_hint(name: str, kind: str) -> None:
    """From the public set's own files, with nothing said about it."""
    if not (DATA / name).is_dir():
        pytest.skip(f"no {name} here")

    result = audit(read_touch(DATA / name, None, lambda *_: None), name)

    finding = next(finding for finding in result.findings if finding.kind == kind)
    assert finding.alarm
    assert finding.alone is not None
    assert finding.majority is not None
    assert finding.alone > finding.majority + 0.15


def _regrouped(touch: TouchSet, sessions: list[str]) -> TouchSet:
    trials = tuple(
        replace(t, groups={"session": s, "recording": t.groups["recording"], "trial": t.recording})
        for t, s in zip(touch.trials, sessions, strict=True)
    )
    return replace(touch, trials=trials)


def _table(folder: Path, *lines: str) -> Path:
    path = folder / "folds.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(line.split(",") for line in lines)
    return path


def test_a_set_of_measured_figures_is_refused_in_few_words(make_set: Make) -> None:
    """A class for each trial is no lack of trials: there are too many values to be classes."""
    touch = make_set["array"]()
    trials = [replace(trial, labels={"force": f"{i / 7:.3f}"})
              for i, trial in enumerate(touch.trials)]  # fmt: skip

    with pytest.raises(BadDataset, match="looks like a measured figure") as caught:
        checked(replace(touch, trials=tuple(trials), target="force"))
    assert "classes, such as 0.000, 0.143, 0.286" in caught.value.got
    assert len(str(caught.value)) < 500
