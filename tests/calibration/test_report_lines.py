"""What a calibration says about the array in words: presses under the wrong name are noticed."""

from typing import Any

import numpy as np
import pytest

from taxel.calibration.characterise import characterise
from taxel.calibration.presses import Press, Script
from taxel.calibration.report import findings, narrow_table, notes
from taxel.calibration.results import PressedRecording
from taxel.calibration.stored import document_of
from taxel.signals import Samples, SensorInfo

RATE_HZ = 100.0
FORCES_N = (0.5, 1.0, 2.0, 4.0)


def lines_about_a_pair(noted: tuple[int, int]) -> list[str]:
    """Return the findings about two pads that are pressed in turn, each shown by the other at 2 %.

    Args:
        noted: Which channel the presses of the first pad, and of the second, are noted under.
    """
    return findings(a_pair(noted))


def a_pair(noted: tuple[int, int], unit: str = "V", in_unit: float = 1.0) -> dict[str, Any]:
    """Return the calibration of that pair, in a unit of which a volt is so many."""
    presses, places = [], []
    for number, (pad, round_, force) in enumerate(
        (pad, round_, force) for pad in (0, 1) for round_ in (1, 2) for force in FORCES_N
    ):
        start_s = 2.0 + 2.0 * number
        places.append((pad, force, start_s))
        presses.append(
            Press(channel=noted[pad], force_n=force, start_s=start_s, end_s=start_s + 0.8,
                  round=round_)
        )  # fmt: skip
    time_s = np.arange(int((places[-1][2] + 3.0) * RATE_HZ)) / RATE_HZ
    values = np.random.default_rng(0).normal(0.1, 0.005, (len(time_s), 2))
    for pad, force, start_s in places:
        on = (time_s >= start_s) & (time_s < start_s + 0.8)
        bump = 0.5 * force * np.sin(np.pi * (time_s[on] - start_s) / 0.8)
        values[on, pad] += bump
        values[on, 1 - pad] += 0.02 * bump
    values *= in_unit
    info = SensorInfo(name="pads", channels=("left", "right"), units=(unit, unit), rate_hz=RATE_HZ)
    taken = PressedRecording(
        samples=Samples.from_values(values, time_s), script=Script(presses=tuple(presses)),
        rate_hz=RATE_HZ,
    )  # fmt: skip
    return document_of(characterise([taken], info), [], {})


def test_a_single_pressed_pad_is_compared_with_none_and_no_converter_is_blamed() -> None:
    (line,) = [line for line in lines_about_a_pair((0, 0)) if "to compare" in line]

    assert line.endswith(" N: fewer than two channels to compare")


def test_a_sensor_far_off_is_not_counted_as_alike_and_large_spreads_are_whole_numbers() -> None:
    pair = a_pair((0, 1))

    def line(spread_pct: float, range_pct: float, outliers: list[str]) -> str:
        alike = {"at": "9 N", "at_least": [False, False], "spread_pct": spread_pct,
                 "range_pct": range_pct, "outliers": outliers}  # fmt: skip
        found = findings({**pair, "at_one_force": alike})
        return next(text for text in found if text.startswith("at 9 N"))

    assert line(8.61, 24.2, ["b"]) == (
        "at 9 N: channels alike within 8.6 % (standard deviation), 24 % from lowest to highest; "
        "far off, not counted: b"
    )
    assert "66 % (standard deviation), 132 % from lowest to highest; none" in line(66.0, 132.0, [])


def test_presses_under_the_wrong_name_get_a_warning_for_each_sensor() -> None:
    warnings = [line for line in lines_about_a_pair((1, 0)) if line.startswith("warning")]

    assert len(warnings) == 2
    assert warnings[0].startswith("warning: while left is pressed, right responds ")
    assert "check the names in the presses" in warnings[0]


def test_ghosts_of_a_fiftieth_get_none() -> None:
    lines = lines_about_a_pair((0, 1))

    assert any("left → right: 2.0%" in line for line in lines)
    assert not any(line.startswith("warning") for line in lines)


@pytest.mark.parametrize(("unit", "in_unit"), [("mV", 1000.0), ("count", 250.0)])
def test_an_array_that_is_not_in_volts_is_shown_in_its_own_unit(unit: str, in_unit: float) -> None:
    """A sensor of 0.5 V/N with 5 mV of noise, in mV and as 250 counts a volt."""
    names, rows = narrow_table(a_pair((0, 1), unit, in_unit))
    volt_names, volt_rows = narrow_table(a_pair((0, 1)))
    shown, in_volts = (
        dict(zip(names, rows[0], strict=True)),
        dict(zip(volt_names, volt_rows[0], strict=True)),
    )

    assert float(in_volts["V/N"]) == pytest.approx(0.5, rel=0.05)
    assert float(shown[f"{unit}/N"]) == pytest.approx(in_unit * float(in_volts["V/N"]), rel=0.01)
    assert float(in_volts["noise mV"]) == pytest.approx(5.0, rel=0.1)
    assert float(shown[f"noise {unit}"]) == pytest.approx(0.005 * in_unit, rel=0.1)
    assert any(note.startswith(f"{unit}/N: slope") for note in notes(a_pair((0, 1), unit)))
