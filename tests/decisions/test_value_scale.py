"""Claims about values in another unit: when they are noted, and that quiet hands are not."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.decisions.still_channels import Motion
from taxel.decisions.value_scale import DUE, LEAST_WINDOWS, ScaleWatch, scale_words

BOTH = np.full(2, 0.002)
MOTION = Motion(windows=500, usual=np.array([1.0, 2.0]), least=0.5, still=np.zeros(2), worst=BOTH,
                again=BOTH, loudest=2.0)  # fmt: skip
TOUCH = np.array([1.0, 2.0], np.float32)


def noted(*moved: np.ndarray) -> list[tuple[float, float]]:
    watch = ScaleWatch(MOTION, "V")
    found = []
    for number, each in enumerate(moved):
        watch.look(each, float(number))
        found += [(scale.time_s, scale.share) for scale in watch.take()]
    return found


def test_millivolts_for_volts_are_noted_once_after_ten_windows() -> None:
    assert noted(*[1000 * TOUCH] * 50) == [(DUE - 1.0, 1000.0)]


def test_rest_between_touches_does_not_hide_another_unit() -> None:
    """Without noise it changes nothing, with noise it counts against, but less."""
    assert noted(*[1000 * TOUCH, 0 * TOUCH, 0 * TOUCH] * 20) == [(3.0 * (DUE - 1), 1000.0)]
    assert len(noted(*[1000 * TOUCH, 0.5 * TOUCH, 0.5 * TOUCH] * 20)) == 1


@pytest.mark.parametrize(
    "moved",
    [
        [5 * TOUCH] * 50,
        [1e-3 * TOUCH] * 50,
        [0 * TOUCH] * 50,
        ([1000 * TOUCH] + [0.01 * TOUCH] * 10) * 50,
        [1000 * TOUCH] * (DUE - 1) + [TOUCH] * 50,
        [np.array([1000.0, 0.0], np.float32)] * 50,
    ],
    ids=["gains five times higher", "quiet hands", "a hung array", "a drop now and then", "a few",
         "no half of the channels"],
)  # fmt: skip
def test_nothing_is_noted_of_what_is_no_other_unit(moved: list[np.ndarray]) -> None:
    watch = ScaleWatch(replace(MOTION, usual=np.array([1.0, 2.0, 1.0])), "V")
    for each in moved:
        watch.look(np.append(each, np.float32(0.5 * each[0] if each[1] else 0.0)), 1.0)
    assert watch.take() == []


def test_where_training_had_far_louder_windows_than_usual_they_are_no_other_unit() -> None:
    """Knocks of 300 times the noise, which is usual where hands rest most of the time."""
    knocks = ScaleWatch(replace(MOTION, loudest=300.0), "V")
    older = ScaleWatch(replace(MOTION, loudest=None), "V")
    for watch in (knocks, older):
        for _ in range(50):
            watch.look(1000 * TOUCH, 1.0)
        assert watch.take() == []
    for _ in range(DUE):
        knocks.look(300_000 * TOUCH, 1.0)
    assert len(knocks.take()) == 1


def test_the_words_name_the_factor_and_the_unit() -> None:
    assert scale_words(1023.0, "V") == (
        "values change about 1,000 times as much within a window as in training: check whether "
        "they are in V"
    )
    assert "about 0.0012 times" in scale_words(0.001234, "V")


def test_a_session_without_touch_is_noted_at_its_end_alone() -> None:
    """A glitch of two windows is no touch; three touches are."""
    watch = ScaleWatch(MOTION, "V")
    for _ in range(LEAST_WINDOWS - 1):
        watch.look(1e-3 * TOUCH, 1.0)
    assert watch.untouched() == ""
    watch.look(TOUCH, 2.0)
    watch.look(TOUCH, 2.0)
    assert watch.take() == []
    assert watch.untouched() == (
        "no window changed as touch does in training: nothing was touched, or values are not in V"
    )
    watch.look(0.1 * TOUCH, 2.0)
    assert watch.untouched() == ""


def test_without_a_window_it_is_noted_what_came_and_what_the_gate_is() -> None:
    watch = ScaleWatch(None, "V", gate=1.55)
    assert (watch.waits, watch.untouched()) == (True, "")
    watch.wait(np.array([np.nan, 0.00213], np.float32))
    watch.wait(np.zeros(0, np.float32))
    assert watch.waiting() == "nothing above the gate of 1.55 V yet, 0.0021 at most"
    assert watch.untouched() == (
        "nothing came above the gate of 1.55 V, 0.0021 at most: nothing was touched, or values "
        "are not in V"
    )
    watch.wait(np.array([1.6], np.float32))
    assert watch.waiting() == "above the gate of 1.55 V, but not yet for a whole window"
    assert watch.untouched() == (
        "no touch stayed above the gate of 1.55 V for a whole window: too short, or too weak"
    )
    watch.look(None, 1.0)
    assert (watch.waits, watch.waiting(), watch.untouched()) == (False, "", "")


def test_where_training_kept_no_motion_nothing_is_said_of_scale() -> None:
    watch = ScaleWatch(None, "V")
    for _ in range(50):
        watch.look(1000 * TOUCH, 1.0)
    assert (watch.take(), watch.untouched(), watch.waits) == ([], "", False)
