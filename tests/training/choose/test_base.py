"""Recordings before they are cut: what is held out by default, and how long trials are."""

from pathlib import Path

import numpy as np

from taxel.evaluation.outer_split import OuterSplit
from taxel.recordings.importing import ImportOptions, ImportRow, import_rows
from taxel.training.choose.preparations import candidate_windows, load_base


def test_objects_are_held_out_where_no_session_is_known(tmp_path: Path):
    rng = np.random.default_rng(5)
    rows = []
    for number in range(24):
        thing = number % 6
        file = tmp_path / f"t{number}.csv"
        values = thing % 2 + rng.normal(0, 0.1, (12, 2))
        file.write_text("a,b\n" + "\n".join(f"{x:.4f},{y:.4f}" for x, y in values) + "\n")
        rows.append(
            ImportRow(file=file, labels={"kind": ("soft", "hard")[thing % 2]},
                      groups={"object": f"o{thing}"}, channels="a[N] b[N]",
                      time="rate:50Hz", sensor="pad")
        )  # fmt: skip
    import_rows(rows, tmp_path / "recordings")
    base = load_base(tmp_path / "recordings", "kind")

    split = OuterSplit().of(base)
    assert split.name == "object held out"
    for fold in split.folds:
        held = {base.trials[i].groups["object"] for i in fold.test}
        assert not held & {base.trials[i].groups["object"] for i in fold.train}


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
