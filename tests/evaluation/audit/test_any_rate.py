"""Arrays of any rate: copies, scaling and lengths are judged by all rows, or it is said."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.errors import BadDataset
from taxel.evaluation.audit import noise, reading
from taxel.evaluation.audit.audit import audit, make_case
from taxel.evaluation.audit.copies import near_copies, same_rows
from taxel.evaluation.audit.fitted_scaling import scaled_values
from taxel.evaluation.audit.gaps import measure_gaps
from taxel.evaluation.audit.noise import shared_noise
from taxel.evaluation.audit.nuisances import read_length
from taxel.evaluation.audit.of_run import _rows
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.touch_set import TouchSet, usual_steps
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo
from taxel.windows.config import WindowConfig

Make = dict[str, Callable[..., TouchSet]]


def pad_set(
    folder: Path, rate_hz: float | tuple[float, float], change: Callable[[list[np.ndarray]], None]
) -> TouchSet:
    """Write sixteen touches of a pad of three taxels, changed before they are written, and read.

    Two rates alternate, as do the classes.
    """
    rng = np.random.default_rng(5)
    rows = []
    for _ in range(16):
        x = np.arange(rng.integers(300, 420))
        bump = np.exp(-(((x - rng.uniform(90, 200)) / rng.uniform(20, 60)) ** 2))
        rows.append(bump[:, None] * rng.uniform(0.3, 1.0, 3) + rng.normal(0, 0.05, (len(x), 3)))
    change(rows)
    names = ("a", "b", "c")
    for index, values in enumerate(rows):
        own_hz = float(np.resize(rate_hz, 16)[index])
        sensor = SensorInfo(name="pad", channels=names, units=("N",) * 3, rate_hz=own_hz)
        manifest = Manifest(sensor=sensor, labels={"texture": "ab"[index % 2]},
                            groups={"session": f"day{index // 2 % 4}"})  # fmt: skip
        with Recorder(folder / f"t{index:02d}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(values, np.arange(len(values)) / own_hz))
    return read_touch(folder, None, lambda *_: None)


@pytest.mark.parametrize(("rate_hz", "shift"), [(250.0, 1), (2000.0, 7), (50.0, 3)])
def test_copies_are_found_at_any_rate_and_shift(tmp_path: Path, rate_hz: float, shift: int) -> None:
    """As they are, times 1.1 with noise, and run backwards, all from another row on."""
    rng = np.random.default_rng(6)

    def copied(rows: list[np.ndarray]) -> None:
        rows[5] = rows[0][shift:]
        rows[6] = (1.1 * rows[1] + rng.normal(0, 0.01, rows[1].shape))[shift:]
        rows[7] = rows[2][::-1][shift:]

    touch = pad_set(tmp_path, rate_hz, copied)
    same = same_rows(touch)
    near, repeats, turned = near_copies(touch, same)

    assert [set(same), set(near), set(turned)] == [{(0, 5)}, {(1, 6)}, {(2, 7)}]
    assert not repeats


def test_honest_trials_of_a_fast_pad_share_no_noise(tmp_path: Path) -> None:
    """Sixteen touches, none of them a copy."""
    touch = pad_set(tmp_path, 250.0, lambda _: None)

    assert not any((same_rows(touch), *near_copies(touch, {})))


def test_values_that_are_held_for_many_rows_are_found_as_copies(tmp_path: Path) -> None:
    """A sensor of 100 Hz that is asked 2,000 times a second."""

    def held(rows: list[np.ndarray]) -> None:
        rows[:] = [np.repeat(row[::4], 20, axis=0) for row in rows]
        rows[5] = rows[0][7:]

    assert set(same_rows(pad_set(tmp_path, 2000.0, held))) == {(0, 5)}


def test_scaling_over_all_scans_is_seen_at_any_rate(tmp_path: Path) -> None:
    """Files of 250 Hz, of mean 0 and deviation 1 over all of their scans."""

    def scaled(rows: list[np.ndarray]) -> None:
        every = np.concatenate(rows)
        rows[:] = [(row - every.mean(axis=0)) / every.std(axis=0) for row in rows]

    touch = pad_set(tmp_path, 250.0, scaled)
    inner = replace(touch, rows=tuple(row[40:] for row in touch.rows),
                    time_s=tuple(times[40:] for times in touch.time_s))  # fmt: skip

    assert scaled_values(make_case(touch, None, 10, 0)).verdict == "leak"
    assert scaled_values(make_case(inner, None, 10, 0)).verdict == "leak"


def test_a_set_too_large_says_what_it_does_not_see(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All files are thinned alike, not below 150 Hz; a copy between the rows seen is not denied."""
    monkeypatch.setattr(reading, "MOST", 8 * 1500)

    def copied(rows: list[np.ndarray]) -> None:
        rows[5] = rows[0][1:]

    touch = pad_set(tmp_path, 1000.0, copied)
    found = {finding.kind: finding for finding in audit(touch, "large").findings}

    assert set(touch.every.values()) == {4}
    assert sum(map(len, touch.rows)) < 1500
    assert touch.rate_hz == pytest.approx(250.0)
    assert found["duplicates"].verdict == "not checked"
    assert "one row of 4" in touch.notes[-1]


def test_only_files_that_are_thinned_are_said_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of 2 kHz are, those of 100 Hz are not; all hold 256 rows."""
    monkeypatch.setattr(reading, "MOST", 8 * 2500)

    def cut(rows: list[np.ndarray]) -> None:
        rows[:] = [row[:256] for row in rows]

    touch = pad_set(tmp_path, (100.0, 2000.0), cut)

    assert "one row of 8 is seen in 8 of 16 recordings" in touch.notes[-1]
    assert read_length(make_case(touch, None, 20, 0)).examples == ("a: 256 rows", "b: 256 rows")


def test_shifted_copies_are_found_among_many_trials() -> None:
    """Twenty of 800."""
    rng = np.random.default_rng(3)
    rows = [rng.normal(0, 1, (100, 4)).astype(np.float32) for _ in range(800)]
    pairs = {(7 * k, 7 * k + 401) for k in range(20)}
    for original, copy in pairs:
        rows[copy] = np.float32(1.1) * rows[original][5:]

    straight, backwards = shared_noise(tuple(rows))
    assert straight.keys() == pairs
    assert not backwards


@pytest.mark.parametrize(("name", "value"), [("MANY", 20), ("_HELD", 24 * 30)])
def test_trials_or_rows_too_many_to_be_compared_are_not_called_clear(
    make_set: Make, monkeypatch: pytest.MonkeyPatch, name: str, value: int
) -> None:
    """Twenty of 24 trials, or 30 of 40 rows."""
    monkeypatch.setattr(noise, name, value)
    monkeypatch.setattr(noise, "_STRETCH", 8)

    found = {
        finding.kind: finding for finding in audit(make_set["array"](trials=24), "large").findings
    }
    for kind in ("near-duplicates", "augmented copies"):
        assert found[kind].verdict == "not checked"
    assert found["duplicates"].verdict == "clear"


def test_lengths_are_reported_in_the_files_own_rows(tmp_path: Path) -> None:
    """At 250 Hz: 200 and 300 rows."""

    def cut(rows: list[np.ndarray]) -> None:
        rows[:] = [row[: 200 + 100 * (index % 2)] for index, row in enumerate(rows)]

    touch = pad_set(tmp_path, 250.0, cut)

    assert read_length(make_case(touch, None, 50, 0)).examples == ("a: 200 rows", "b: 300 rows")


def test_missing_sessions_are_said_without_a_split(make_set: Make) -> None:
    """They cannot be held out, nor their leak be measured."""
    touch = make_set["array"]()
    trials = [replace(trial, groups={k: v for k, v in trial.groups.items() if k != "session"})
              for trial in touch.trials]  # fmt: skip

    def verdicts(touch: TouchSet) -> dict[str, str]:
        return {finding.kind: finding.verdict for finding in audit(touch, "x").findings}

    assert verdicts(replace(touch, trials=tuple(trials)))["same session"] == "not checked"
    assert "same session" not in verdicts(touch)


def test_cheap_trees_see_what_is_faster_than_the_windows_grid(tmp_path: Path) -> None:
    """Tones of 400 and 800 Hz at 2 kHz, which rows of 100 Hz cannot tell apart."""

    def tones(rows: list[np.ndarray]) -> None:
        rng = np.random.default_rng(7)
        for index, row in enumerate(rows):
            x = np.arange(len(row)) / 2000.0
            tone = np.sin(2 * np.pi * (400 + 400 * (index % 2)) * x + rng.uniform(0, 6))
            rows[index] = tone[:, None] + rng.normal(0, 0.3, row.shape)

    touch = pad_set(tmp_path, 2000.0, tones)

    gaps = measure_gaps(make_case(touch, None, usual_steps(touch), 0))
    assert gaps[0].low > 0.9


def test_a_window_of_a_run_spans_its_own_time_at_the_recordings_rate(make_set: Make) -> None:
    """Twelve rows of the grid of 100 Hz are 30 at 250 Hz, 15 where every second row is held."""
    touch = make_set["array"]()
    contract = SimpleNamespace(rate_hz=250.0, window=WindowConfig(steps=12))

    assert _rows(contract, touch) == 30  # type: ignore[arg-type]
    assert _rows(contract, replace(touch, every={"r00.mcap": 2})) == 15  # type: ignore[arg-type]


def test_a_number_that_stands_for_an_overload_is_refused_by_its_place(tmp_path: Path) -> None:
    """As 9.91E37 of many instruments; trees compare values, and what they square is infinite."""

    def overloaded(rows: list[np.ndarray]) -> None:
        rows[3][25, 1] = 9.91e37

    with pytest.raises(BadDataset, match=r"channel 'b' in t03.mcap, at 0.10 s"):
        pad_set(tmp_path, 250.0, overloaded)
