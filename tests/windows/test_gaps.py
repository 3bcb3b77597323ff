"""Short gaps are filled in and said; long or many ones leave a window unusable; live as offline."""

import numpy as np
import pytest

from taxel.signals import Samples, SensorInfo, Validity
from taxel.windows.config import WindowConfig
from taxel.windows.gaps import fill_gaps
from taxel.windows.windower import Windower, Windows, cut_windows

SENSOR = SensorInfo(name="t", channels=("a", "b"), units=("N", "N"), rate_hz=100.0)
WINDOW = WindowConfig(steps=75, stride=25, grid_hz=None)


def samples(missing: np.ndarray) -> Samples:
    """Return scans whose values are a ramp, some of them lost: as the wire gives them, 0."""
    n = len(missing)
    ramp = np.stack([np.arange(n), 1000.0 - np.arange(n)], axis=1).astype(np.float32)
    lost = np.repeat(missing[:, None], 2, axis=1)
    time_s = np.arange(n) / 100.0
    return Samples(
        values=np.where(lost, np.float32(0), ramp),
        validity=np.where(lost, Validity.MISSING, Validity.GOOD).astype(np.uint8),
        counter=np.arange(n),
        device_s=time_s,
        arrival_s=time_s,
        fitted_s=time_s,
    )


def tenth(n: int = 400) -> np.ndarray:
    """Return one lost scan in ten, evenly, and some that follow one another."""
    lost = np.arange(n) % 20 == 7
    lost |= np.arange(n) % 40 == 8
    return lost | (np.arange(n) % 40 == 30)


def test_a_tenth_of_lost_scans_silences_no_window() -> None:
    """A ramp is restored to the last digit, and each window says how much of it is filled in."""
    windows = cut_windows(samples(tenth()), WINDOW, SENSOR)

    assert windows.ready.all()
    assert (windows.usable < 1.0).all()  # what was missing stays missing
    np.testing.assert_allclose(windows.filled, 1.0 - windows.usable)
    expected = np.arange(75) + 100.0 * windows.start_s[:, None]
    for values, ramp, start_s in zip(windows.values, expected, windows.start_s, strict=True):
        first = round(100 * start_s)
        good = np.flatnonzero(~tenth()[first : first + 75])
        inner = slice(good[0], good[-1] + 1)  # at a window's ends the nearest value is held
        np.testing.assert_allclose(values[inner, 0], ramp[inner], atol=1e-3)
        np.testing.assert_array_equal(values[: good[0], 0], values[good[0], 0])


@pytest.mark.parametrize("lost", [np.arange(400) % 50 < 6, np.arange(400) % 3 == 1])
def test_a_long_gap_or_too_many_leave_the_window_unusable(lost: np.ndarray) -> None:
    """Six rows in a row of 75, or a third of all, are not made up."""
    windows = cut_windows(samples(lost), WINDOW, SENSOR)

    assert not windows.ready.any()
    assert (windows.filled == 0).all()


def test_windows_of_twelve_rows_are_never_filled() -> None:
    """A fifteenth of twelve rows is none: one missing scan means UNKNOWN, as ever."""
    lost = np.arange(48) == 5
    windows = cut_windows(samples(lost), WindowConfig(grid_hz=None), SENSOR)

    assert windows.ready.tolist() == [False, True, True, True]


@pytest.mark.parametrize("call", [1, 7, 90, 400])
def test_live_fills_what_offline_fills(call: int) -> None:
    """However the stream is cut into calls, values, shares and windows are the same."""
    stream = samples(tenth())
    whole = cut_windows(stream, WINDOW, SENSOR)
    windower = Windower(WINDOW, SENSOR)
    parts = [windower.push(stream[i : i + call]) for i in range(0, len(stream), call)]
    live = Windows.join([*parts, windower.flush()])

    for name in ("values", "usable", "filled", "start_s"):
        np.testing.assert_array_equal(getattr(live, name), getattr(whole, name))


def test_a_dead_channel_is_not_made_up() -> None:
    """A channel without a usable value leaves nothing to fill it from."""
    usable = np.ones((75, 2), bool)
    usable[:, 1] = False

    assert fill_gaps(np.zeros((75, 2), np.float32), usable, 75, 0.9) is None
