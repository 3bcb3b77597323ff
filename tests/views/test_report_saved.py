"""Saved results on the page: known by what they hold, refused by name."""

from typing import Any

import pytest
from saved_results import SWEEP, transition_tables

from taxel.errors import BadInput
from taxel.evaluation.teng.table_4_1 import ROWS
from taxel.views.report.measured_parts import read_sweep, sweep_part
from taxel.views.report.saved_parts import saved_part


def test_a_saved_table_of_cameras_stands_beside_the_published_values():
    title, inside = saved_part(transition_tables(), "t.json")

    assert title == "Grasp transitions: Tables 1 to 3"
    assert "98.90" in inside
    assert "31.84" in inside
    assert "97.0 [95.0, 98.0]" in inside
    assert "difference of pixels" in inside
    assert "parity with the paper" in inside


def test_saved_warnings_and_slips_and_table_4_1_are_known():
    events = {
        "clusters": 5, "runs": 10, "events": 4, "lead_median_s": None,
        "lead_interval_s": [None, None], "lead_p5_s": None, "lead_p95_s": None,
        "missed_share": 0.5, "false_alarms_per_min": 2.0, "false_alarms_poisson": [1.0, 3.0],
        "early_share": 0.0,
    }  # fmt: skip
    warned = [{"name": "gel+lstm", "windows": {"balanced": 0.9, "auc": None}, "events": events,
               "by": {"force": {"15": events}}, "thresholds": []}]  # fmt: skip
    slips = {"trials": 150, "target": "slipped", "split": "object held out", "crops_a_trial": 3,
             "crop": 48, "folds": 5,
             "rows": [{"name": "ours", "trials": {"accuracy": 0.92, "auc": 0.97}}]}  # fmt: skip
    column = {"rows": dict.fromkeys(ROWS, 0.91),
              "pooled": {"scores": {"accuracy": 0.91}, "interval": [None, None]}}  # fmt: skip
    teng = [{"preset": "honest", "task": "shape", "split": "session held out",
             "columns": {"cnn2d": column}, "trivial": {"majority": 0.3}}]  # fmt: skip

    assert "by force" in saved_part(warned, "w")[1]
    assert "0.920" in saved_part(slips, "s")[1]
    assert "150 trials, 3 crops of 48 frames each;" in saved_part(slips, "s")[1]
    newer = saved_part({**slips, "every": 4, "of_moving_part": True}, "s")[1]
    assert "3 crops of 48 images, one in 4 frames, of the part in which something moves" in newer
    assert "0.9983" in saved_part(teng, "t")[1]


@pytest.mark.parametrize("data", [{}, [], [{"columns": 1, "preset": 2}], {"rows": []}, 3])
def test_a_saved_file_of_another_kind_is_refused_by_name(data: Any):
    with pytest.raises(BadInput, match=r"x\.json"):
        saved_part(data, "x.json")


@pytest.mark.parametrize(
    "rows",
    [[], {}, 1, [{"fault": "n"}], [{**SWEEP[0], "accuracy": 1.5}], [{**SWEEP[0], "level": "a"}]],
)
def test_a_sweep_of_another_kind_is_refused_by_name(rows: Any):
    with pytest.raises(BadInput, match=r"x\.json"):
        read_sweep(rows, "x.json")


def test_a_sweep_shows_what_is_unchanged_and_where_nothing_is_answered():
    rows = [
        {**SWEEP[0], "fault": "none", "level": 0.0, "accuracy": 0.85, "low": None, "high": None},
        *SWEEP,
        {**SWEEP[0], "fault": "dead", "level": 1.0, "unit": "channels", "accuracy": 0.5},
        {**SWEEP[0], "fault": "dust", "accuracy": None, "low": None, "high": None, "answered": 0.0},
    ]

    part = sweep_part(read_sweep(rows, "s.json"))

    assert "Unchanged: 85.0 %" in part
    assert "noise: least 50.0 % [40.0, 60.0] at 0 dB" in part
    assert "at 1 channel</figcaption>" in part
    assert "dust: nothing was answered" in part
    assert "nan" not in part


def test_a_level_that_leaves_other_windows_is_drawn_beside_what_those_gave_without_it():
    clean = {**SWEEP[0], "fault": "none", "level": 0.0, "accuracy": 0.85}
    fewer = [{**SWEEP[0], "fault": "skew", "level": float(level), "base": 0.95} for level in (1, 2)]
    flat, raised = (
        sweep_part(read_sweep([clean, *rows], "s.json"))
        for rows in ([{**row, "base": None} for row in fewer], fewer)
    )

    def grey(page: str) -> set[str]:
        (line,) = [
            element
            for element in page.split("<")
            if element.startswith("polyline") and "grey" in element
        ]
        return {pair.split(",")[1] for pair in line.split('points="')[1].split('"')[0].split()}

    assert len(grey(flat)) == len(grey(raised)) == 1
    assert float(grey(raised).pop()) < float(grey(flat).pop()), "higher on the page is more"


def test_a_figure_that_one_row_lacks_leaves_the_others_in_their_columns():
    """What is not finite is saved as null: the figures behind it stood under another heading."""
    rows = [
        {"name": "ours", "trials": {"trials": 4, "accuracy": 0.5, "auc": 0.6, "loss": 0.7}},
        {"name": "bar", "trials": {"trials": 4, "accuracy": 0.1, "auc": None, "loss": 0.3}},
    ]
    data = {"rows": rows, "crops_a_trial": 3, "crop": 8, "target": "shape", "trials": 4,
            "split": "random", "folds": 2}  # fmt: skip
    _, page = saved_part(data, "scores.json")
    assert "<td>bar</td><td>0.100</td><td>–</td><td>0.300</td>" in page
    assert "<th>name</th><th>accuracy</th><th>auc</th><th>loss</th>" in page
