"""What a calibration says about the array in words: presses under the wrong name are noticed."""

import numpy as np

from taxel.calibration.characterise import characterise
from taxel.calibration.presses import Press, Script
from taxel.calibration.report import findings
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
    info = SensorInfo(name="pads", channels=("left", "right"), units=("V", "V"), rate_hz=RATE_HZ)
    taken = PressedRecording(
        samples=Samples.from_values(values, time_s), script=Script(presses=tuple(presses)),
        rate_hz=RATE_HZ,
    )  # fmt: skip
    return findings(document_of(characterise([taken], info), [], {}))


def test_presses_under_the_wrong_name_get_a_warning_for_each_sensor() -> None:
    warnings = [line for line in lines_about_a_pair((1, 0)) if line.startswith("warning")]

    assert len(warnings) == 2
    assert warnings[0].startswith("warning: while left is pressed, right responds ")
    assert "check the names in the presses" in warnings[0]


def test_ghosts_of_a_fiftieth_get_none() -> None:
    lines = lines_about_a_pair((0, 1))

    assert any("left → right: 2.0%" in line for line in lines)
    assert not any(line.startswith("warning") for line in lines)
