"""Windows are the same however a stream is cut into calls."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.signals import Samples, SensorInfo, Validity
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.windower import Windower, Windows, cut_windows


def sensor(channels: int = 3, rate_hz: float = 100.0) -> SensorInfo:
    return SensorInfo(
        name="test",
        channels=tuple(f"c{i}" for i in range(channels)),
        units=("V",) * channels,
        rate_hz=rate_hz,
        full_scale=3.3,
    )


def stream(n: int, channels: int = 3, rate_hz: float = 100.0, seed: int = 0) -> Samples:
    """Bursts of contact between stretches of rest."""
    rng = np.random.default_rng(seed)
    level = np.repeat(rng.random(n // 40 + 1) < 0.4, 40)[:n] * 2.0
    values = level[:, None] + rng.normal(0, 0.4, (n, channels))
    return Samples.from_values(values, np.arange(n) / rate_hz, full_scale=3.3)


def in_pieces(samples: Samples, config: WindowConfig, info: SensorInfo, cuts: list[int]) -> Windows:
    windower = Windower(config, info)
    edges = [0, *sorted(cuts), len(samples)]
    parts = [windower.push(samples[a:b]) for a, b in pairwise(edges)]
    return Windows.join([*parts, windower.flush()])


def assert_equal(a: Windows, b: Windows) -> None:
    for name in ("values", "mask", "usable", "saturated", "start_s", "end_s"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


CONFIGS = {
    "gated B": WindowConfig(gate=1.0, max_gap_s=0.1),
    "gated A": WindowConfig(gate=1.0, layout="A", max_gap_s=0.1),
    "overlapping": WindowConfig(steps=10, stride=3),
    "stride longer than the window": WindowConfig(steps=4, stride=9, gate=1.0, max_gap_s=0.1),
    "padded and tared": WindowConfig(
        steps=30, stride=30, gate=1.0, max_gap_s=0.1, pad=True, tare=True
    ),
    "own scans as rows": WindowConfig(steps=7, stride=5, grid_hz=None),
    "slower grid": WindowConfig(steps=5, stride=5, grid_hz=30.0),
}


@pytest.mark.parametrize("name", CONFIGS)
@given(cuts=st.lists(st.integers(0, 600), max_size=12))
@settings(max_examples=25, deadline=None)
def test_any_cutting_of_a_stream_gives_the_windows_of_the_whole(name: str, cuts: list[int]) -> None:
    config, info, samples = CONFIGS[name], sensor(), stream(600)

    assert_equal(in_pieces(samples, config, info, cuts), cut_windows(samples, config, info))


@pytest.mark.parametrize("piece", [1, 600])
def test_a_stretch_without_one_whole_row_gives_no_window(piece: int) -> None:
    """Layout A: two of three channels lie above the gate for one row, then rest, then contact."""
    config = WindowConfig(steps=30, stride=30, gate=1.0, layout="A", max_gap_s=0.1, pad=True)
    values = np.zeros((100, 3))
    values[5, :2] = 2.0
    values[50:55] = 2.0
    samples = Samples.from_values(values, np.arange(100) / 100.0, full_scale=3.3)

    found = in_pieces(samples, config, sensor(), list(range(piece, 100, piece)))

    assert found.mask.sum(axis=1).tolist() == [5]
    assert found.start_s.tolist() == [0.5]
    assert found.values.shape == (1, 30, 3)


def test_one_scan_at_a_time_gives_the_windows_of_the_whole() -> None:
    info, samples = sensor(rate_hz=1000.0), stream(3000, rate_hz=1000.0)
    whole = cut_windows(samples, TENG_WINDOW, info)

    assert len(whole) > 3
    assert_equal(in_pieces(samples, TENG_WINDOW, info, list(range(3000))), whole)


def test_a_window_holds_the_scans_that_were_put_in() -> None:
    """Channel 0 carries the scan's number, so a lost, repeated or moved scan would show."""
    n = 100
    values = np.tile(np.arange(n, dtype=np.float64)[:, None], (1, 2))
    samples = Samples.from_values(values, np.arange(n) / 100.0)

    windows = cut_windows(samples, WindowConfig(steps=12, stride=12), sensor(2))

    assert windows.values.shape == (8, 12, 2)
    np.testing.assert_array_equal(windows.values[:, :, 0].ravel(), np.arange(96))
    np.testing.assert_allclose(windows.start_s, np.arange(8) * 0.12)
    np.testing.assert_allclose(windows.end_s, np.arange(8) * 0.12 + 0.11)


def test_the_gate_keeps_whole_scans() -> None:
    values = np.zeros((50, 3))
    values[10:22, 1] = 2.0
    values[10:22, 2] = 0.5
    samples = Samples.from_values(values, np.arange(50) / 100.0)

    windows = cut_windows(samples, TENG_WINDOW, sensor())

    assert windows.values.shape == (1, 12, 3)
    np.testing.assert_array_equal(windows.values[0], values[10:22].astype(np.float32))


def test_layout_a_fills_an_image_with_survivors_of_any_channel() -> None:
    values = np.zeros((40, 3))
    values[:, 0] = 2.0 + np.arange(40) * 0.01
    config = WindowConfig(steps=3, stride=3, gate=1.0, layout="A")

    windows = cut_windows(Samples.from_values(values, np.arange(40) / 100.0), config, sensor())

    assert windows.values.shape == (4, 3, 3)
    np.testing.assert_allclose(windows.values[0].ravel(), values[:9, 0].astype(np.float32))


def test_rows_on_both_sides_of_a_gap_never_share_a_window() -> None:
    values = np.full((20, 2), 2.0)
    time = np.concatenate([np.arange(10) / 100.0, 5.0 + np.arange(10) / 100.0])
    samples = Samples.from_values(values, time)

    assert len(cut_windows(samples, TENG_WINDOW, sensor(2))) == 0


def test_a_short_stretch_is_padded_masked_and_counted() -> None:
    values = np.arange(10.0).reshape(5, 2) + 3.0
    config = WindowConfig(steps=8, stride=8, pad=True, tare=True)

    windows = cut_windows(Samples.from_values(values, np.arange(5) / 100.0), config, sensor(2))

    assert windows.padded == 1
    np.testing.assert_array_equal(windows.mask[0], [True] * 5 + [False] * 3)
    np.testing.assert_array_equal(windows.values[0, :5], values - values[0])
    assert (windows.values[0, 5:] == 0).all()


def test_a_fast_sensor_is_taken_at_the_grid() -> None:
    """1 kHz scans become rows 10 ms apart, each the latest scan at its tick."""
    n = 1000
    values = np.tile(np.arange(n, dtype=np.float64)[:, None], (1, 2))
    samples = Samples.from_values(values, np.arange(n) / 1000.0)

    windows = cut_windows(samples, WindowConfig(), sensor(2, 1000.0))

    np.testing.assert_array_equal(windows.values[:, :, 0].ravel(), np.arange(96) * 10)


def test_a_value_older_than_the_limit_is_not_usable() -> None:
    time = np.concatenate([np.arange(50) / 1000.0, 0.2 + np.arange(50) / 1000.0])
    samples = Samples.from_values(np.full((100, 2), 2.0), time)
    config = WindowConfig(steps=20, stride=20)

    windows = cut_windows(samples, config, sensor(2, 1000.0))

    # ticks 0…0.19 s: those up to 0.049 + 0.030 s have a fresh value, 8 of 20.
    assert windows.usable[0] == pytest.approx(8 / 20)
    assert (windows.values[0, 8:] == 0).all()


def test_a_nan_is_marked_not_passed_on() -> None:
    values = np.full((12, 3), 2.0)
    values[5, 1] = np.nan
    windows = cut_windows(Samples.from_values(values, np.arange(12) / 100.0), TENG_WINDOW, sensor())

    assert np.isfinite(windows.values).all()
    assert windows.usable[0] == pytest.approx(35 / 36)


def test_a_channel_at_the_rail_is_reported() -> None:
    values = np.full((12, 3), 2.0)
    values[:, 2] = 3.3
    windows = cut_windows(
        Samples.from_values(values, np.arange(12) / 100.0, full_scale=3.3), TENG_WINDOW, sensor()
    )

    assert windows.saturated[0] == 1.0


@pytest.mark.parametrize("scans", [12, 24])
def test_of_one_window_or_several_the_channel_most_often_at_the_rail_counts(scans: int) -> None:
    values = np.full((scans, 3), 2.0)
    values[:3, 1] = values[:2, 2] = 3.3
    samples = Samples.from_values(values, np.arange(scans) / 100.0, full_scale=3.3)

    windows = cut_windows(samples, TENG_WINDOW, sensor())

    assert windows.saturated.tolist() == [0.25, 0.0][: scans // 12]


def test_it_is_known_how_many_rows_the_next_window_waits_for() -> None:
    """Windows of 4 rows, 5 rows between them, of which the first comes with the window's last."""
    windower = Windower(WindowConfig(steps=4, stride=9, grid_hz=None), sensor())
    samples = stream(5)
    found = [windower.missing]
    for part in (samples[:3], samples[3:]):
        windower.push(part)
        found.append(windower.missing)

    assert found == [4, 1, 8]


def test_missing_scans_do_not_open_the_gate() -> None:
    samples = Samples.from_values(np.full((24, 2), 2.0), np.arange(24) / 100.0)
    samples.validity[:12] = Validity.MISSING

    windows = cut_windows(samples, TENG_WINDOW, sensor(2))

    assert len(windows) == 1
    assert windows.start_s[0] == pytest.approx(0.12)
