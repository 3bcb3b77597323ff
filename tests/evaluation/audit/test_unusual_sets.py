"""Clean recordings of an unusual kind raise no alarm, and their leaks are found all the same."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from trial_makers import Write, as_avi, as_folder, write_trials

from taxel.errors import BadDataset, BadSplit, BadTable
from taxel.evaluation.audit.affine import scaled_over_channels
from taxel.evaluation.audit.audit import audit, make_case
from taxel.evaluation.audit.both_sides import shared_names
from taxel.evaluation.audit.copies import near_copies, rows_backwards, same_rows
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.fitted_scaling import scaled_values
from taxel.evaluation.audit.origins import read_origins
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.sides import named_sides, table_sides
from taxel.evaluation.audit.touch_set import TouchSet, checked, usual_steps
from taxel.recordings.imports.importing import import_table

Make = dict[str, Callable[..., TouchSet]]


def grouped(touch: TouchSet, of: Callable[[int], dict[str, str]]) -> TouchSet:
    """Return the set with more groups a trial."""
    trials = [
        replace(trial, groups={**trial.groups, **of(i)}) for i, trial in enumerate(touch.trials)
    ]
    return replace(touch, trials=tuple(trials))


def by_kind(touch: TouchSet, split: str, claimed: tuple[str, ...] = ()) -> dict[str, Finding]:
    """Return what stands on both sides of a split, by kind."""
    sides = named_sides(touch, split, usual_steps(touch), 5, 0, claimed)
    return {
        finding.kind: finding
        for finding in shared_names(make_case(touch, sides, usual_steps(touch), 0))
    }


def coarse(touch: TouchSet, seed: int) -> TouchSet:
    """Return the set with slow waves on one channel instead, read in a few steps."""
    rng = np.random.default_rng(seed)
    waves = [1.0 * np.sin(np.arange(40) / 3 + rng.uniform(0, 6)) + rng.normal(0, 0.3, 40)
             for _ in range(len(touch))]  # fmt: skip
    rows = tuple(np.round(wave)[:, None].astype(np.float32) for wave in waves)
    return replace(touch, views=("array",), rows=rows)


@pytest.mark.parametrize(("trials", "classes"), [(8, 4), (10, 5)])
def test_a_few_trials_of_many_classes_are_audited(
    make_set: Make, trials: int, classes: int
) -> None:
    """Two of each class cannot make five folds."""
    touch = make_set["array"](trials=trials, classes=1)
    dealt = [replace(trial, labels={"shape": f"c{i * classes // trials}"}) for i, trial in
             enumerate(touch.trials)]  # fmt: skip

    assert not audit(replace(touch, trials=tuple(dealt)), "few").alarms


def test_one_trial_a_class_is_refused(make_set: Make) -> None:
    """Nothing can be learned of a class and tested."""
    touch = make_set["array"](trials=8)
    trials = [replace(trial, labels={"shape": f"c{i}"}) for i, trial in enumerate(touch.trials)]

    with pytest.raises(BadDataset, match="several of a class"):
        checked(replace(touch, trials=tuple(trials)))


def test_single_readings_are_audited_and_what_needs_time_is_named(tmp_path: Path) -> None:
    """Grasps of one row each, of two channels: too few to tell copies, and it is said."""
    (tmp_path / "a.csv").write_text("x,y\n" + "".join(f"{i},{i % 3}\n" for i in range(20)))
    (tmp_path / "t.csv").write_text("file,channels,time\na.csv,x[N] y[N],rate:1Hz\n")
    spans = "".join(f"a,{i},{i + 0.5},{'xy'[i % 2]}\n" for i in range(19))
    (tmp_path / "i.csv").write_text(f"file,start_s,end_s,label:outcome\n{spans}")
    import_table(tmp_path / "t.csv", tmp_path / "set", intervals=tmp_path / "i.csv")

    touch = read_touch(tmp_path / "set", "outcome", lambda *_: None)
    assert {len(rows) for rows in touch.rows} == {1}
    found = audit(touch, "single")
    verdicts = {finding.kind: finding.verdict for finding in found.findings}
    assert any("length, place, first row, level" in note for note in found.notes)
    assert verdicts["duplicates"] == verdicts["near-duplicates"] == "not checked"
    assert not {"length", "place", "first frame", "level", "augmented copies"} & verdicts.keys()


def with_a_short_trial(folder: Path) -> TouchSet:
    """Return 18 marked trials of ten rows, with one of one row at 9.9 s and one without a label."""
    (folder / "a.csv").write_text("x,y\n" + "".join(f"{i % 7},{i % 3}\n" for i in range(220)))
    (folder / "t.csv").write_text("file,channels,time\na.csv,x[N] y[N],rate:10Hz\n")
    spans = "".join(f"{i},{i + (0.9 if i == 9 else 1)},{'xy'[i % 2]}\n" for i in range(20))
    (folder / "i.csv").write_text(f"start_s,end_s,label:outcome\n{spans}9.9,10,x\n")
    import_table(folder / "t.csv", folder / "set", intervals=folder / "i.csv")
    touch = read_touch(folder / "set", "outcome", lambda *_: None)
    return replace(touch.only(np.arange(19)), left_out=(
        *touch.left_out, replace(touch.trials[19], labels={})))  # fmt: skip


def test_lines_of_trials_that_are_left_out_are_passed_over(tmp_path: Path) -> None:
    """As `train` takes them: the line of a trial of one row, and of one without the label."""
    touch = with_a_short_trial(tmp_path)
    lines = [f"a,{s},{'train' if s < 8 else 'test'}" for s in (*map(float, range(20)), 9.9)]
    table = tmp_path / "folds.csv"
    table.write_text("\n".join(["recording,start_s,side", *lines]) + "\n")

    pieces, sides = table_sides(touch, table, steps=4)

    assert "1 trial of fewer than 3 rows: left out" in touch.notes
    assert pieces.trial.tolist() == list(range(19))
    assert [len(side) for side in sides.folds[0]] == [8, 11]
    table.write_text("recording,start_s,side\na,1,train\na,9.9,test\n")
    with pytest.raises(BadSplit, match=r"trials to test in test; got none: .*left out"):
        table_sides(touch, table, steps=4)
    table.write_text("recording,start_s,side\na,1,train\na,21,test\n")
    with pytest.raises(BadTable, match=r"folds\.csv, line 3, which lies in none"):
        table_sides(touch, table, steps=4)
    start = float(touch.time_s[18][-1]) + 0.0004  # where tables round: moves no neighbour
    behind = replace(touch.trials[18], start_s=start, end_s=start + 1.0, labels={})
    near = f"a,{start:.4f},test"
    table.write_text(f"recording,start_s,side\na,1,train\na,2,train\na,3,test\n{near}\n")
    for left_out, moved in (touch.left_out, [1, 2, 3, 18]), ((behind,), [1, 2, 3]):
        own = replace(touch, left_out=left_out)
        assert sorted(table_sides(own, table, steps=4)[0].trial) == moved


def readings(touch: TouchSet, channels: int = 12, step: float = 0.001) -> TouchSet:
    """Return the set with one reading a trial, its class's pattern with noise, in steps."""
    rng = np.random.default_rng(3)
    pattern = rng.uniform(1, 2, (3, channels))
    rows = tuple(np.asarray(np.round(own / step) * step, np.float32)[None]
                 for own in pattern[touch.y] * rng.normal(1, 0.2, (60, channels)))  # fmt: skip
    return replace(touch, rows=rows, views=("array",) * channels,
                   time_s=(np.zeros(1),) * len(touch))  # fmt: skip


def test_copies_of_single_readings_are_found_and_honest_ones_are_none(make_set: Make) -> None:
    """Trials 0 and 1 are of two sessions: the same values, and others times 1.3 and rounded."""
    touch = readings(make_set["array"]())
    assert not audit(touch, "x").alarms

    rows = list(touch.rows)
    rows[1] = rows[0]
    rows[3] = np.asarray(np.round(1.3 * rows[2] + 2.0, 3), np.float32)
    rows[9] = np.asarray(rows[8] * np.random.default_rng(0).normal(1, 0.01, 12), np.float32)
    spoilt = replace(touch, rows=tuple(rows))
    for split, verdict in ((None, "leak"), ("group:session", "leak")):
        sides = None if split is None else named_sides(spoilt, split, 1, 5, 0)
        found = {finding.kind: finding for finding in audit(spoilt, "x", sides).findings}
        assert found["duplicates"].verdict == found["near-duplicates"].verdict == verdict
        assert found["duplicates"].examples[0].startswith("r00#0 and r01#0")
        assert [own[:15] for own in found["near-duplicates"].examples] == ["r02#0 and r03#0"]


@pytest.mark.parametrize(("channels", "step"), [(12, 1.0), (4, 0.001)], ids=["coarse", "few"])
def test_single_readings_that_meet_by_chance_are_not_checked(
    make_set: Make, channels: int, step: float
) -> None:
    """Values of three steps, or of four channels."""
    found = {finding.kind: finding for finding in
             audit(readings(make_set["array"](), channels, step), "x").findings}  # fmt: skip

    assert found["duplicates"].verdict == "not checked"
    assert found["near-duplicates"].verdict in ("clear", "not checked")


def test_light_touches_in_counts_are_no_copies_of_each_other(make_set: Make) -> None:
    """Each channel rests at a level of its own, which scale and offset meet in any two readings."""
    touch = make_set["array"]()
    rng = np.random.default_rng(0)
    counts = rng.integers(100, 900, 30) + rng.normal(0, 0.5, (len(touch), 30))
    for trial, number in enumerate(touch.y):
        counts[trial, number * 8 : number * 8 + 6] += 6 * rng.uniform(0.5, 1)
    rows = tuple(np.round(own)[None].astype(np.float32) for own in counts)
    light = replace(touch, rows=rows, views=("array",) * 30, time_s=(np.zeros(1),) * len(touch))

    assert not audit(light, "x").alarms


def test_one_taxel_that_answers_is_no_copy_of_another_force() -> None:
    """All others stay at zero: scale alone makes any such reading of any other."""
    first, other = np.zeros((2, 16), np.float32)
    first[3], other[3] = 1.0, 2.5

    assert not scaled_over_channels(first, other, np.full(16, 0.001))
    bowl = np.arange(16, dtype=np.float32) ** 2
    assert scaled_over_channels(bowl, 3 * bowl + 1, np.zeros(16))


def test_one_operator_and_one_pad_on_both_sides_of_held_out_sessions_are_a_limit(
    make_set: Make,
) -> None:
    """No leak: the figure holds for them; where they are claimed to be unseen, it is one."""
    touch = grouped(
        make_set["array"](), lambda i: {"operator": "ann", "pad": "xy"[(i % 5) % 2], "day": "1"}
    )

    found = by_kind(touch, "group:session")
    assert found["same session"].verdict == "clear"
    assert {found[f"same {key}"].verdict for key in ("operator", "pad", "day")} == {"note"}
    assert by_kind(touch, "group:session", ("pad",))["same pad"].verdict == "leak"


def test_sessions_on_both_sides_are_a_leak_though_pads_are_held_out(make_set: Make) -> None:
    """What was recorded together is alike whatever it was recorded with."""
    touch = grouped(make_set["array"](), lambda i: {"pad": "xyz"[i // 5 % 4 % 3]})

    found = by_kind(touch, "group:pad")
    assert found["same pad"].verdict == "clear"
    assert found["same session"].verdict == "leak"


def test_trials_scaled_each_by_itself_are_no_leak(make_set: Make) -> None:
    """Nothing of a test trial stands in a training trial; over all rows it does."""
    touch = make_set["array"]()
    own = tuple((r - r.mean(axis=0)) / r.std(axis=0) for r in touch.rows)
    every = np.concatenate(touch.rows)
    whole = tuple((r - every.mean(axis=0)) / every.std(axis=0) for r in touch.rows)

    finding = scaled_values(make_case(replace(touch, rows=own), None, 10, 0))
    assert finding.verdict == "note"
    assert finding.message.startswith("Each trial")
    assert scaled_values(make_case(replace(touch, rows=whole), None, 10, 0)).verdict == "leak"


@pytest.mark.parametrize("seed", range(4))
def test_coarse_values_that_meet_by_chance_are_no_copies(make_set: Make, seed: int) -> None:
    """One channel of a few steps; a true copy among them is found."""
    touch = coarse(make_set["array"](trials=20), seed)
    assert not same_rows(touch)

    copied = replace(touch, rows=(*touch.rows[:-1], touch.rows[0]))
    assert list(same_rows(copied)) == [(0, len(touch) - 1)]


@pytest.mark.parametrize("seed", range(3))
def test_one_short_trial_hides_no_copy_among_coarse_values(make_set: Make, seed: int) -> None:
    """45 % of a trial stand in another; a trial of eight rows has no runs long enough to tell."""
    rng = np.random.default_rng(seed)
    waves = [np.sin(np.arange(120) / 3 + rng.uniform(0, 6)) for _ in range(40)]
    rows = [np.round(wave + rng.normal(0, 0.5, 120))[:, None].astype(np.float32) for wave in waves]
    rows[5][10:64] = rows[0][20:74]
    rows[20] = rows[20][:8]

    assert set(same_rows(replace(make_set["array"](trials=40), rows=tuple(rows))) or {}) == {(0, 5)}


def test_copies_that_cannot_be_told_from_chance_are_not_denied(make_set: Make) -> None:
    """Values of two steps that hardly change."""
    touch = make_set["array"]()
    rows = tuple(np.asarray(row[:, :1] > 0.8, np.float32) for row in touch.rows)
    steps = replace(touch, views=("array",), rows=rows)

    found = {finding.kind: finding for finding in audit(steps, "coarse").findings}
    assert found["duplicates"].verdict == "not checked"


@pytest.mark.parametrize("seed", range(2))
def test_pulses_of_a_few_steps_are_no_copies_either_way_round(make_set: Make, seed: int) -> None:
    """One channel in steps of half a pulse: few rows say something, and those meet by chance."""
    touch = make_set["array"](seed)
    rows = tuple(np.asarray(np.round(2 * row[:, :1]) / 2, np.float32) for row in touch.rows)
    steps = replace(touch, views=("array",), rows=rows)

    assert not same_rows(steps)
    assert not rows_backwards(steps)


def test_a_trial_copied_often_is_found(make_set: Make) -> None:
    """Fifteen copies of one trial, as oversampling makes them, are not taken for rest."""
    touch = make_set["array"]()
    copied = replace(touch, rows=(touch.rows[0],) * 15 + touch.rows[15:])

    assert len(same_rows(copied)) == 15 * 14 / 2


def test_a_file_that_holds_several_sessions_is_only_how_trials_are_stored(make_set: Make) -> None:
    """A table a class, with sessions named in it; without sessions the file tells the class."""
    touch = make_set["array"]()
    stored = grouped(touch, lambda i: {"recording": touch.trials[i].labels["shape"]})
    sessionless = replace(stored, trials=tuple(
        replace(trial, groups={k: v for k, v in trial.groups.items() if k != "session"})
        for trial in stored.trials))  # fmt: skip

    def kinds(touch: TouchSet) -> set[str]:
        found = read_origins(make_case(touch, None, 10, 0))
        return {finding.kind for finding in found if finding.finding(finding.evidence.p).alarm}

    assert "name: recording" not in kinds(stored)
    assert "name: recording" in kinds(sessionless)


@pytest.mark.parametrize("seed", range(3))
def test_a_machines_repeats_of_one_touch_are_a_note_and_a_noisy_copy_of_one_a_leak(
    make_set: Make, seed: int
) -> None:
    """Thirty objects, pressed three times each with the same force: only their noise differs."""
    rng = np.random.default_rng(seed)
    touch, x = make_set["array"](trials=90), np.arange(80)
    gains, rise = rng.uniform(0.3, 1.0, (30, 6)), rng.uniform(4, 15, 30)
    rows = []
    for index in range(90):
        start = 20 + rng.uniform(-1, 1)
        press = np.clip((x - start) / rise[index % 30], 0, 1) * np.clip((72 - x) / 6, 0, 1)
        own = press[:, None] * gains[index % 30] * rng.normal(1, 0.02, 6)
        rows.append((own + rng.normal(0, 0.01, (80, 6))).astype(np.float32))
    time_s = (x / 20.0,) * 90

    near, repeats, _ = near_copies(replace(touch, rows=tuple(rows), time_s=time_s), {})
    assert not near
    assert len(repeats) > 5

    noise = rng.normal(0, 0.05, (80, 6)) * rows[0].std(axis=0) * 0.3
    rows[1] = np.asarray(1.3 * rows[0] + 2.0 + noise, np.float32)
    near, _, _ = near_copies(replace(touch, rows=tuple(rows), time_s=time_s), {})
    assert list(near) == [(0, 1)]


def squeezes(touch: TouchSet, seed: int) -> TouchSet:
    """Return the set with squeezes of six fruits at four depths instead, 30 taxels, in steps.

    Values are multiples of 1/1600. Two squeezes of a fruit differ by far more than that.
    """
    rng = np.random.default_rng(seed)
    shape = np.cumsum(rng.uniform(0.2, 1.0, (6, 4, 30)), axis=1)
    rows = []
    for index in range(len(touch)):
        own = shape[index % 6] * rng.normal(1, 0.15, 30) + rng.normal(0, 0.01, (4, 30)) + 1.0
        rows.append((np.round(own * 1600) / 1600).astype(np.float32))
    return replace(touch, views=("array",) * 30, rows=tuple(rows),
                   time_s=(np.arange(4) / 20.0,) * len(rows))  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_of_four_rows_alike_squeezes_are_a_note_and_true_copies_are_found(
    make_set: Make, seed: int
) -> None:
    """Two numbers a channel are the course of a touch, not noise."""
    touch = squeezes(make_set["array"](trials=90), seed)
    rows = list(touch.rows)
    rng = np.random.default_rng(9)
    rows[6] = np.asarray(rows[0] + rng.normal(0, 0.02, (4, 30)), np.float32)  # as alike as a copy

    honest = replace(touch, rows=tuple(rows))
    near, repeats, _ = near_copies(honest, {})
    assert not near
    assert (0, 6) in repeats
    finding = next(f for f in audit(honest, "x").findings if f.kind == "near-duplicates")
    assert finding.verdict == "note"
    assert "not decided" in finding.message

    rows[7] = np.asarray(np.round((1.3 * rows[1] + 2.0) * 1600) / 1600, np.float32)
    rows[8] = np.asarray(0.7 * rows[2] - 1.0, np.float32)
    rows[9] = rows[3]
    copied = replace(touch, rows=tuple(rows))
    same = same_rows(copied)
    assert same == {(3, 9): 1.0}
    assert set(near_copies(copied, same)[0]) == {(1, 7), (2, 8)}


def test_straight_lines_are_no_copies_of_each_other(make_set: Make) -> None:
    """Ramps of 30 rows: any is another scaled and offset, and none shows any noise."""
    rng = np.random.default_rng(0)
    ramp = np.arange(30.0)[:, None]
    lines = tuple(np.asarray(ramp * rng.integers(1, 9, 6), np.float32) for _ in range(60))
    touch = replace(make_set["array"](), rows=lines, time_s=(np.arange(30) / 20.0,) * 60)

    assert not near_copies(replace(touch, rows=(*lines[:-1], 2 * lines[0])), {})[0]


@pytest.mark.parametrize("write", [as_avi, as_folder])
def test_a_table_of_videos_is_audited_in_place(tmp_path: Path, write: Write) -> None:
    """No import is asked for, and nothing is written beside it."""
    table = write_trials(tmp_path, objects=3, each=4, frames=12, write=write)
    before = sorted(tmp_path.rglob("*"))
    touch = read_touch(table, None, lambda what, done, of: None)
    assert (touch.kind, touch.target, len(touch.trials)) == ("camera", "slipped", 12)
    assert {rows.shape for rows in touch.rows} == {(12, 48)}
    assert touch.group("object") is not None
    assert sorted(tmp_path.rglob("*")) == before


def test_measured_figures_as_classes_are_said_once_and_flood_nothing(make_set: Make) -> None:
    """30 values in 60 trials: one note, and none of scikit-learn's warnings a tree."""
    touch = make_set["array"]()
    trials = [
        replace(trial, labels={"shape": f"{(i % 30) / 7:.3f}"})
        for i, trial in enumerate(touch.trials)
    ]
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        found = audit(replace(touch, trials=tuple(trials)), "d")

    assert [str(w.message) for w in seen if "unique classes" in str(w.message)] == []
    assert [note for note in found.notes if "looks like a measured figure" in note]
    assert not [note for note in audit(touch, "d").notes if "figure" in note]
