"""Robustness curves as table and figure."""

import io
from dataclasses import replace

import pytest
from rich.console import Console

from taxel.evaluation.robustness.curve import CLEAN, FaultPoint, level_text
from taxel.views.figures.sweep import sweep_figure
from taxel.views.tables.sweep import sweep_table

NAN = float("nan")
BASE = FaultPoint(
    fault=CLEAN, level=0.0, unit="", accuracy=0.95, low=0.93, high=0.97, answered=1.0,
    windows=1660, grasps=0.91, grasps_answered=0.95, outside=0.8,
)  # fmt: skip
NOISE = [
    replace(BASE, fault="noise", unit="dB", level=level, accuracy=accuracy)
    for level, accuracy in ((30.0, 0.94), (20.0, 0.92), (10.0, 0.66))
]
SILENT = replace(
    BASE, fault="missing", unit="channels", level=1.0, accuracy=NAN, low=NAN, high=NAN,
    answered=0.0, grasps=0.0, grasps_answered=0.0,
)  # fmt: skip


def printed(points: list[FaultPoint], cameras: bool = False, width: int = 110) -> str:
    console = Console(width=width, file=io.StringIO())
    console.print(sweep_table(points, "shape · b.taxel on d", cameras=cameras))
    text = console.file.getvalue()
    assert isinstance(text, str)
    return text


def test_the_table_says_level_interval_change_and_where_five_points_are_gone():
    text = printed([BASE, *NOISE, SILENT])

    assert "0.920 [0.930, 0.970]" in text
    assert "-29.0" in text
    assert "noise          19.2 dB" in text
    assert "nothing answered" in text
    assert "not before 1 channel, where nothing is answered" in text
    assert "1,660" in text
    assert "draws" not in text
    assert "…" not in text.replace("0…1", "")  # nothing is cut off


def test_the_table_says_how_many_draws_are_pooled_and_where_little_is_answered():
    dead = [replace(BASE, fault="dead", unit="channels", level=level, draws=4,
                    grasps_answered=share)
            for level, share in ((1.0, 0.9), (2.0, 0.3), (3.0, 0.2))]  # fmt: skip
    text = printed([BASE, *dead])

    assert "4 draws" in text
    assert "dead           not up to 3 channels; at 2 channels only 30.0 % with an answer" in text
    assert "dead, channels, 4 draws" in printed([BASE, dead[0]])


def test_the_table_says_where_nothing_is_answered_also_after_accuracy_has_fallen():
    damp = [replace(NOISE[2], fault="humidity", unit="% RH", level=30.0),
            replace(SILENT, fault="humidity", unit="% RH", level=80.0)]  # fmt: skip

    assert "humidity       30 % RH; at 80 % RH nothing is answered" in printed([BASE, *damp])

    few = replace(damp[0], level=65.0, grasps_answered=0.2)
    text = printed([BASE, damp[0], few, damp[1]], width=200)
    assert "30 % RH; at 65 % RH only 20.0 % with an answer; at 80 % RH nothing is answered" in text


def test_no_figure_is_cut_off_where_the_terminal_is_narrow():
    wide = replace(NOISE[0], fault="channel-drift", unit="% of full scale", accuracy=1.0, low=0.9,
                   high=1.0, level=50_000.5, draws=4, windows=166_012)  # fmt: skip
    for width in (110, 80):
        text = printed([BASE, wide], width=width)
        assert "…" not in text
        assert "1.000]" in text
        assert "166,012" in text


def test_the_interval_is_spoken_of_where_there_is_one():
    alone = replace(BASE, low=NAN, high=NAN)

    assert "Interval: sessions resampled" in printed([BASE, SILENT])
    assert "No interval: one session only" in " ".join(printed([alone, SILENT]).split())
    assert "sessions resampled" not in printed([alone, SILENT])


def test_a_grasp_bundles_table_speaks_of_moments_and_slips():
    text = printed([BASE, *NOISE], cameras=True)

    assert "moments" in text
    assert "false: alarms" in text


def test_the_figure_is_a_png_that_grows_with_its_panels():
    single = sweep_figure([BASE, *NOISE], "title", chance=1 / 3)
    two = sweep_figure([BASE, *NOISE, SILENT], "title", cameras=True)

    assert single.startswith(b"\x89PNG")
    assert int.from_bytes(two[16:20]) > int.from_bytes(single[16:20])


def test_a_figure_without_any_fault_is_still_one():
    assert sweep_figure([BASE], "title").startswith(b"\x89PNG")


@pytest.mark.parametrize(("level", "unit", "shown"), [
    (1.0, "channels", "1 channel"), (2.0, "channels", "2 channels"), (1.0, "ms", "1 ms"),
    (0.5, "channels", "0.5 channels"), (1.0, "pairs", "1 pair"), (1.0, "stops", "1 stop"),
    (1.0, "scratches", "1 scratch"),
])  # fmt: skip
def test_one_of_what_is_counted_is_named_in_the_singular(
    level: float, unit: str, shown: str
) -> None:
    assert level_text(level, unit) == shown
