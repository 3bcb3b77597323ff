"""Recordings before they are cut: what is held out by default, and how long trials are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadSplit
from taxel.evaluation.expert import learned_windows
from taxel.evaluation.outer_split import OuterSplit
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.table_split import GivenSplit
from taxel.recordings.imports.importing import ImportOptions, ImportRow, import_rows, import_table
from taxel.training.choose.base import Base, load_base
from taxel.training.choose.preparations import candidate_windows, live_note, prepare_all
from taxel.training.motion import measure_motion
from taxel.windows.dataset import load_dataset


@pytest.mark.parametrize("group", ["object", "person"])
def test_objects_or_persons_are_held_out_where_no_session_is_known(tmp_path: Path, group: str):
    rng = np.random.default_rng(5)
    rows = []
    for number in range(24):
        thing = number % 6
        kind = thing if group == "object" else number // 6
        file = tmp_path / f"t{number}.csv"
        values = kind % 2 + rng.normal(0, 0.1, (12, 2))
        file.write_text("a,b\n" + "\n".join(f"{x:.4f},{y:.4f}" for x, y in values) + "\n")
        rows.append(
            ImportRow(file=file, labels={"kind": ("soft", "hard")[kind % 2]},
                      groups={group: f"o{thing}"}, channels="a[N] b[N]",
                      time="rate:50Hz", sensor="pad")
        )  # fmt: skip
    import_rows(rows, tmp_path / "recordings")
    base = load_base(tmp_path / "recordings", "kind")

    split = OuterSplit().of(base)
    assert split.name == f"{group} held out"
    for fold in split.folds:
        held = {base.trials[i].groups[group] for i in fold.test}
        assert not held & {base.trials[i].groups[group] for i in fold.train}


def test_a_tables_validation_trials_are_learned_from_for_inner_folds_choose(tmp_path: Path):
    base = marked_set(tmp_path, 40)
    names = [trial.groups["trial"] for trial in base.trials]
    sides = ["test", "validation", *["train"] * (len(names) - 2)]
    table = tmp_path / "folds.csv"
    lines = [f"{name},{side}" for name, side in zip(names, sides, strict=True)]
    table.write_text("\n".join(["group:trial,side", *lines]) + "\n")

    (fold,) = OuterSplit(given=GivenSplit(table=table)).of(base).folds

    assert isinstance(fold, TrialFold)
    assert fold.test == {0}
    assert fold.train == set(range(1, len(names)))
    assert not fold.validation


def test_lost_scans_do_not_shorten_a_trial(tmp_path: Path):
    rng = np.random.default_rng(6)
    rows = []
    for number in range(12):
        file = tmp_path / f"t{number}.csv"
        values = number % 2 + rng.normal(0, 0.1, (60, 2))
        lines = [f"{x:.4f},{y:.4f}" for x, y in values]
        for lost in range(10, 60, 15):
            lines[lost] = "nan,nan"
        file.write_text("a,b\n" + "\n".join(lines) + "\n")
        rows.append(
            ImportRow(file=file, labels={"kind": ("soft", "hard")[number % 2]},
                      groups={"session": f"s{number // 4}"}, channels="a[N] b[N]",
                      time="rate:50Hz", sensor="pad")
        )  # fmt: skip
    import_rows(rows, tmp_path / "recordings", options=ImportOptions(missing="keep"))
    base = load_base(tmp_path / "recordings", "kind")

    assert base.dataset.missing == 48
    assert base.rows.tolist() == [60] * 12
    assert [config.steps for config in candidate_windows(base)] == [60]


def marked_set(folder: Path, rows: int) -> Base:
    """Return one long recording at 50 Hz; each trial begins 3 + 2·rows after the last."""
    rng = np.random.default_rng(0)
    every = 2 * rows + 3
    lines = ["a,b", *(f"{a:.3f},{b:.3f}" for a, b in rng.normal(size=(12 * every + 9, 2)))]
    (folder / "long.csv").write_text("\n".join(lines) + "\n")
    table = "\n".join(
        f"long,{(3 + n * every) / 50},{(3 + n * every + rows) / 50},{'xy'[n % 2]}"
        for n in range(12)
    )
    (folder / "marks.csv").write_text(f"file,start_s,end_s,label:kind\n{table}\n")
    (folder / "table.csv").write_text("file,channels,time\nlong.csv,a[N] b[N],rate:50Hz\n")
    import_table(folder / "table.csv", folder / "set", intervals=folder / "marks.csv")
    return load_base(folder / "set", "kind")


def test_touches_of_few_rows_that_marks_part_are_a_window_each(tmp_path: Path):
    """However they lie in their recording: none is lost because a window starts beside its mark."""
    base = marked_set(tmp_path, 10)

    (prepared,) = prepare_all(base)

    assert prepared.config.steps == 10
    assert prepared.trial.tolist() == list(range(12))
    assert "about 1 of 12" in live_note(base, prepared.config)[0]


@pytest.mark.parametrize("rows", [20, 50, 101])
def test_windows_of_marked_touches_lie_inside_them_live_too(tmp_path: Path, rows: int):
    """Windows as a bundle cuts them, one after another from the first scan: each holds one."""
    base = marked_set(tmp_path, rows)

    config = candidate_windows(base)[0]

    assert not live_note(base, config)
    live = load_dataset(base.path, config, target="kind")
    assert len(live.trials) == 12
    assert prepare_all(base)[0].config == config


def presses(folder: Path, seed: int, *, dead: bool) -> Path:
    """Import twelve touches of two channels, of which the second may be dead."""
    rng = np.random.default_rng(seed)
    folder.mkdir()
    rows = []
    for number in range(12):
        file = folder / f"t{number}.csv"
        values = number % 2 + rng.normal(0, 0.1, (30, 2))
        values[:, 1] *= not dead
        file.write_text("a,b\n" + "\n".join(f"{x:.4f},{y:.4f}" for x, y in values) + "\n")
        rows.append(
            ImportRow(file=file, labels={"kind": ("soft", "hard")[number % 2]},
                      channels="a[N] b[N]", time="rate:50Hz", sensor="pad")
        )  # fmt: skip
    import_rows(rows, folder / "recordings")
    return folder / "recordings"


def test_what_is_tested_only_is_no_part_of_what_a_bundle_knows_of_training(tmp_path: Path):
    """A channel that is dead in the folder to test on moved in all windows of training."""
    own, test = (presses(tmp_path / name, len(name), dead=name == "later")
                 for name in ("own", "later"))  # fmt: skip
    base = load_base(own, "kind", test=test)
    (prepared,) = prepare_all(base)

    learned = learned_windows(base, prepared, base.own)

    assert len(learned) == 12
    assert not any(name.startswith("test/") for name in learned.fingerprints)
    assert learned.config == prepared.config
    both, alone = (measure_motion(data, "kind") for data in (prepared.dataset, learned))
    assert both is not None
    assert alone is not None
    assert both.still[1] > 0.3
    assert alone.still[1] == 0.0


def array_files(folder: Path, lengths: list[int], classes: str = "xy") -> Path:
    """Import a trial for each length, its class in turn; return where to."""
    folder.mkdir()
    rng = np.random.default_rng(len(lengths))
    lines = ["file,label:kind,channels,time"]
    for n, rows in enumerate(lengths):
        np.savetxt(folder / f"{n}.csv", rng.normal(size=(rows, 2)), delimiter=",")
        lines.append(f"{n}.csv,{classes[n % len(classes)]},1[N] 2[N],rate:50Hz")
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    import_table(folder / "table.csv", folder / "set")
    return folder / "set"


def test_trials_that_are_only_tested_do_not_make_windows_longer(tmp_path: Path):
    """One long trial in the folder to test on made all training windows nine tenths padding."""
    train = array_files(tmp_path / "train", [60] * 8)
    test = array_files(tmp_path / "test", [60, 60, 60, 700, 60])

    (alone,) = candidate_windows(load_base(train, "kind"))
    (window,) = candidate_windows(load_base(train, "kind", test=test))

    assert (window.steps, window.pad) == (alone.steps, alone.pad) == (60, False)


def test_a_class_that_is_only_tested_is_refused(tmp_path: Path):
    """The saved model claimed it, though it had never seen it."""
    train = array_files(tmp_path / "train", [60] * 8)
    test = array_files(tmp_path / "test", [60] * 6, classes="xyz")

    with pytest.raises(BadSplit, match=r"every tested class of 'kind'.*none of z"):
        OuterSplit().of(load_base(train, "kind", test=test))


def test_shorter_trials_that_are_only_tested_are_padded(tmp_path: Path):
    train = array_files(tmp_path / "train", [60] * 8)
    test = array_files(tmp_path / "test", [40, 60, 60])

    (window,) = candidate_windows(load_base(train, "kind", test=test))

    assert (window.steps, window.pad) == (60, True)


def test_where_all_trials_are_as_long_it_is_said_that_shorter_ones_get_no_answer(tmp_path: Path):
    base = load_base(array_files(tmp_path / "like", [60] * 8), "kind")
    (window,) = candidate_windows(base)
    assert live_note(base, window)[0].startswith("a trial of fewer than 60 rows gets no answer")
    assert not live_note(base, replace(window, steps=25, stride=25))

    varied = load_base(array_files(tmp_path / "varied", [60, 60, 60, 60, 40, 50]), "kind")
    (window,) = candidate_windows(varied)
    assert "is decided where its recording ends" in live_note(varied, window)[0]


def test_a_trial_in_no_row_of_which_every_channel_has_a_value_stops_nothing(tmp_path: Path):
    """As a logger writes that takes its channels in turn: only windows are filled."""
    folder = tmp_path / "files"
    folder.mkdir()
    rng = np.random.default_rng(1)
    lines = ["file,label:kind,channels,time"]
    for n in range(10):
        values = rng.normal(size=(60, 5))
        if n == 3:
            values[np.arange(60), np.arange(60) % 5] = np.nan
        np.savetxt(folder / f"{n}.csv", values, delimiter=",")
        lines.append(f"{n}.csv,{'xy'[n % 2]},1[N] 2[N] 3[N] 4[N] 5[N],rate:50Hz")
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    options = ImportOptions(missing="keep")
    import_table(folder / "table.csv", folder / "set", options=options)

    base = load_base(folder / "set", "kind")
    (prepared,) = prepare_all(base)

    assert len(set(prepared.trial)) == 9
    assert "1 of 10 trials is left out, such as 3" in " ".join(base.notes)
