"""A board that slows down after it was opened is noticed."""

import numpy as np
import pytest

from taxel.live.rate_watch import RateChange, RateWatch
from taxel.signals import Samples


def rows(times_s: np.ndarray) -> Samples:
    return Samples.from_values(np.ones((len(times_s), 1)), times_s)


def found(watch: RateWatch, times_s: np.ndarray) -> list[RateChange]:
    """What is reported of rows that come one by one."""
    for time_s in times_s:
        watch.look(rows(np.array([time_s])))
    return watch.take()


def test_a_rate_that_changes_is_reported_once_and_so_is_its_end() -> None:
    periods_s = np.concatenate([np.full(200, 0.01), np.full(300, 0.02), np.full(700, 0.01)])
    slow, back = found(RateWatch(100.0), np.cumsum(periods_s))
    assert (slow.fits, back.fits) == (False, True)
    assert slow.rate_hz == pytest.approx(50.0, rel=0.02)
    assert 2.0 + 3.9 <= slow.time_s <= 2.0 + 6.1  # the second span of 2 s that is slow
    assert slow.words().startswith("rows come at 5")
    assert "in training at 100 Hz: do not trust the answers" in slow.words()
    assert back.words() == "rows come at 100 Hz again, as in training"


@pytest.mark.parametrize("ratio", [0.81, 1.24])
def test_what_may_be_opened_is_no_change(ratio: float) -> None:
    assert found(RateWatch(100.0), np.arange(1000) / (100.0 * ratio)) == []


@pytest.mark.parametrize("ratio", [0.79, 1.26])
def test_what_may_not_be_opened_is(ratio: float) -> None:
    (change,) = found(RateWatch(100.0), np.arange(1000) / (100.0 * ratio))
    assert not change.fits


def test_a_rate_at_the_limit_is_reported_once_at_most() -> None:
    draw = np.random.default_rng(0)
    periods_s = draw.normal(1 / 80, 0.02 / 80, 24_000)
    assert len(found(RateWatch(100.0), np.cumsum(periods_s))) <= 1


@pytest.mark.parametrize("real_hz", [500.0, 2000.0])
def test_lines_that_come_in_lumps_have_a_rate_too(real_hz: float) -> None:
    """Sixteen lines at a time, put 1 ms apart as at the rate that was measured at opening."""
    watch, came_s = RateWatch(1000.0), np.arange(1, 1000) * 16 / real_hz
    for at_s in came_s:
        times_s = np.maximum(at_s - np.arange(15, -1, -1) / 1000.0, at_s - 16 / real_hz)
        watch.look(rows(times_s))
    (change,) = watch.take()
    assert change.rate_hz == pytest.approx(real_hz, rel=0.05)


def test_pauses_and_jitter_are_no_other_rate() -> None:
    draw = np.random.default_rng(0)
    periods_s = 0.01 * draw.uniform(0.5, 1.5, 2000)
    periods_s[::40] = 0.4
    assert found(RateWatch(100.0), np.cumsum(periods_s)) == []


def test_few_rows_say_nothing_and_a_clock_that_stands_still_neither() -> None:
    watch = RateWatch(100.0)
    assert found(watch, np.arange(60) / 20.0) == []
    assert found(RateWatch(100.0), np.zeros(500)) == []
