"""The signal's own decay is measured while the force stays, and never on the release."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from taxel.calibration.presses import Press, Script, script_of_marks
from taxel.calibration.responses import Responses, measure_responses
from taxel.signals import Samples

RATE_HZ = 200.0
HELD_S = 0.8
STARTS = np.arange(3.0, 30.0, 3.0)


def presses_of(course: Callable[[np.ndarray], np.ndarray], margin_s: float) -> Responses:
    """Return presses whose signal follows a course of the seconds since the touch."""
    time_s = np.arange(round(33.0 * RATE_HZ)) / RATE_HZ
    volts = 0.05 + np.random.default_rng(0).normal(0.0, 0.004, len(time_s))
    for start in STARTS:
        volts += course(time_s - start)
    script = Script(presses=tuple(
        Press(channel=0, force_n=1.0, start_s=start - margin_s, end_s=start + HELD_S + margin_s)
        for start in STARTS
    ))  # fmt: skip
    samples = Samples.from_values(volts[:, None].astype(np.float32), time_s)
    return measure_responses(samples, script, RATE_HZ)


def square(since_s: np.ndarray) -> np.ndarray:
    return ((since_s >= 0.0) & (since_s < HELD_S)).astype(float)


def by_hand(since_s: np.ndarray) -> np.ndarray:
    """Pressed and let go of within 0.1 s each."""
    return np.clip(since_s / 0.1, 0.0, 1.0) * np.clip((HELD_S - since_s) / 0.1, 0.0, 1.0)


def tap(since_s: np.ndarray) -> np.ndarray:
    return np.clip(1.0 - np.abs(since_s - 0.2) / 0.2, 0.0, 1.0)


def creep(since_s: np.ndarray) -> np.ndarray:
    """The plateau sinks by a quarter, which says nothing of a time constant."""
    return square(since_s) * (1.0 - 0.25 * since_s / HELD_S)


@pytest.mark.parametrize("margin_s", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("course", [square, by_hand, tap, creep])
def test_a_signal_that_falls_with_the_release_has_no_decay(
    course: Callable[[np.ndarray], np.ndarray], margin_s: float
) -> None:
    found = presses_of(course, margin_s)

    assert np.isnan(found.fall_s).all()
    assert np.isfinite(found.rise_s).all() or margin_s == 0.0


@pytest.mark.parametrize("tau_s", [0.1, 0.3, 0.8])
def test_a_decay_under_the_force_is_measured_however_much_of_it_is_left(tau_s: float) -> None:
    found = presses_of(lambda since_s: square(since_s) * np.exp(-since_s.clip(0) / tau_s), 0.1)

    assert np.median(found.fall_s) == pytest.approx(tau_s, rel=0.1)


def test_the_simulated_hands_decay_is_found(three_boards: Any) -> None:
    script = script_of_marks(three_boards.marks, three_boards.gauge.info)
    found = measure_responses(three_boards.samples, script, 250.0).fall_s

    assert np.isfinite(found).mean() > 0.95
    assert np.nanmedian(found) == pytest.approx(0.18, abs=0.02)
