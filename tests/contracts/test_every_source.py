"""Every source fulfils one contract: each scan once, in order, in time, nothing after the end."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples
from taxel.sources.contract import Source
from taxel.sources.opening import SCHEMES, open_source

SCANS = 1600
RATE_HZ = 200
OPENED_S = 1000.0
URLS = {
    "honest": f"sim://teng?seconds=8&rate_hz={RATE_HZ}",
    "one-board": f"sim://teng?seconds=8&rate_hz={RATE_HZ}&wiring=one-board&seed=3",
    "paper": f"sim://teng?seconds=8&rate_hz={RATE_HZ}&preset=paper&shape=sphere&material=glass",
    "replay": "replay://{folder}/recorded.mcap",
    "bare file": "{folder}/recorded.mcap",
}
ELSEWHERE = {
    "serial": (
        "tests/sources/test_serial_contract.py",
        "test_each_scan_comes_once_oldest_first_however_it_is_read",
        "test_time_starts_at_opening_and_never_runs_backwards",
        "test_a_scan_is_not_given_before_it_arrives",
        "test_all_that_is_due_comes_at_once",
        "test_the_timeout_is_kept",
        "test_leaving_the_block_closes_it_and_nothing_comes_after",
    ),
    "camera": (
        "tests/sources/test_camera_source.py",
        "test_frames_come_whole_once_in_order_and_on_time",
        "test_reading_ends_with_a_frame_or_after_the_timeout",
        "test_closing_ends_the_processes_and_the_source",
    ),
    "realsense": (
        "tests/sources/test_realsense.py",
        "test_frames_come_whole_once_in_order_and_on_time",
        "test_reading_ends_with_a_frame_or_after_the_timeout",
        "test_closing_ends_the_streams_and_the_source",
    ),
}
"""Schemes of real devices, which keep to no manual clock: the file that opens them, and the
claims in it that stand for the ones here."""
Opener = Callable[[ManualClock, str], Source]


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording of the simulated hand, marks and all."""
    folder = tmp_path_factory.mktemp("every-source")
    with (
        open_source(URLS["honest"] + "&speed=max", ManualClock()) as source,
        Recorder(folder / "recorded.mcap", Manifest(sensor=source.info)) as recorder,
    ):
        while not source.ended:
            recorder.write(source.read())
            recorder.flush()
            for mark in source.marks():
                recorder.mark(mark)
    return folder


@pytest.fixture(params=URLS)
def opener(request: pytest.FixtureRequest, recorded: Path) -> Opener:
    def make(clock: ManualClock, speed: str = "1") -> Source:
        url = URLS[request.param].format(folder=recorded)
        return open_source(f"{url}{'&' if '?' in url else '?'}speed={speed}", clock)

    return make


def read_all(source: Source, timeout_s: float = 0.1) -> tuple[Samples, list[Mark]]:
    """Read to the end; at most as often as there are scans and silences."""
    parts, marks = [], []
    for _ in range(10 * SCANS):
        parts.append(source.read(timeout_s))
        marks += source.marks()
        if source.ended:
            return Samples.join(parts), marks
    raise AssertionError("the source never ended")


def test_every_scheme_is_under_contract():
    """Here, or in a file of its own that still holds the claims named for it."""
    here = {url.partition("://")[0] for url in URLS.values() if "://" in url}
    assert here | set(ELSEWHERE) == set(SCHEMES)
    assert not here & set(ELSEWHERE)
    for name, *claims in ELSEWHERE.values():
        text = (Path(__file__).parents[2] / name).read_text()
        for claim in claims:
            assert f"def {claim}(" in text, f"{name} no longer claims {claim}"


@pytest.mark.parametrize("speed", ["1", "7.5", "max"])
def test_each_scan_comes_once_oldest_first(opener: Opener, speed: str):
    with opener(ManualClock(OPENED_S), speed) as source:
        samples, _ = read_all(source)
    np.testing.assert_array_equal(samples.counter, np.arange(SCANS))


def test_however_it_is_read_the_scans_and_marks_are_the_same(opener: Opener):
    """A hasty reader, a patient one and one that sleeps in between get equal values and stamps."""

    def collect(timeout_s: float, nap_s: float) -> tuple[Samples, list[Mark]]:
        clock = ManualClock(OPENED_S)
        with opener(clock, "1") as source:
            parts, marks = [], []
            while not source.ended:
                clock.sleep(nap_s)
                parts.append(source.read(timeout_s))
                marks += source.marks()
        return Samples.join(parts), marks

    first, marks = collect(0.1, 0.0)
    assert marks
    for timeout_s, nap_s in ((0.003, 0.0), (0.1, 0.7), (0.0, 20.0)):
        other, other_marks = collect(timeout_s, nap_s)
        for name in ("values", "counter", "device_s", "arrival_s", "fitted_s", "validity"):
            np.testing.assert_array_equal(getattr(other, name), getattr(first, name))
        assert other_marks == marks


def test_info_describes_what_is_read(opener: Opener):
    with opener(ManualClock(OPENED_S), "max") as source:
        info = source.info
        samples, _ = read_all(source)
    assert samples.values.shape == (SCANS, len(info.channels))
    assert samples.values.dtype == np.float32
    span_s = samples.fitted_s[-1] - samples.fitted_s[0]
    assert (SCANS - 1) / span_s == pytest.approx(info.rate_hz, rel=1e-2)


def test_time_starts_at_opening_and_never_runs_backwards(opener: Opener):
    with opener(ManualClock(OPENED_S), "max") as source:
        samples, _ = read_all(source)
    assert samples.fitted_s[0] == pytest.approx(OPENED_S, abs=1e-9)
    for name in ("fitted_s", "arrival_s", "device_s"):
        assert (np.diff(getattr(samples, name)) >= 0).all(), name


def test_a_scan_is_not_given_before_it_arrives(opener: Opener):
    clock = ManualClock(OPENED_S)
    with opener(clock, "1") as source:
        while not source.ended:
            samples = source.read(0.02)
            assert (samples.arrival_s <= clock.now_s()).all()


def test_all_that_is_due_comes_at_once(opener: Opener):
    """After three seconds in which nobody read, one read gives all of them and does not wait."""
    clock = ManualClock(OPENED_S)
    with opener(clock, "1") as source:
        clock.advance(3.0)
        samples = source.read(0.1)
        assert clock.now_s() == OPENED_S + 3.0
        assert 3.0 * RATE_HZ - 10 <= len(samples) <= 3.0 * RATE_HZ + 1
        assert source.read(0.0).counter.tolist() == []


def test_the_timeout_is_kept(opener: Opener):
    clock = ManualClock(OPENED_S)
    with opener(clock, "0.001") as source:  # a scan every five seconds
        source.read(10.0)
        before_s = clock.now_s()
        assert len(source.read(0.25)) == 0
        assert clock.now_s() == pytest.approx(before_s + 0.25, abs=1e-9)


def test_speed_hurries_the_release_and_leaves_the_stamps(opener: Opener):
    def run(speed: str) -> tuple[float, Samples]:
        clock = ManualClock(OPENED_S)
        with opener(clock, speed) as source:
            samples, _ = read_all(source)
        return clock.now_s() - OPENED_S, samples

    (slow_s, slow), (fast_s, fast), (max_s, _) = run("1"), run("4"), run("max")
    assert slow_s == pytest.approx(SCANS / RATE_HZ, abs=0.05)
    assert fast_s == pytest.approx(slow_s / 4, abs=0.05)
    assert max_s == 0.0
    np.testing.assert_array_equal(fast.fitted_s, slow.fitted_s)


def test_marks_come_once_and_never_before_their_last_scan(opener: Opener):
    with opener(ManualClock(OPENED_S), "1") as source:
        given_s, marks = OPENED_S, []
        while not source.ended:
            samples = source.read()
            given_s = samples.fitted_s[-1] if len(samples) else given_s
            done = source.marks()
            assert all(OPENED_S <= mark.start_s < mark.end_s <= given_s for mark in done)
            marks += done
    assert len(marks) >= 1
    assert all({"shape", "material"} <= set(mark.labels) for mark in marks)
    assert len({mark.start_s for mark in marks}) == len(marks)


def test_nothing_comes_after_the_end_and_nobody_waits_for_it(opener: Opener):
    clock = ManualClock(OPENED_S)
    with opener(clock, "1") as source:
        read_all(source)
        before_s = clock.now_s()
        assert len(source.read(5.0)) == 0
        assert source.marks() == []
        assert (source.ended, clock.now_s()) == (True, before_s)


def test_leaving_the_block_closes_it(opener: Opener):
    with opener(ManualClock(OPENED_S), "max") as source:
        assert len(source.read())
        assert not source.ended or len(source.read()) == 0
    assert source.ended
    assert (len(source.read()), source.marks()) == (0, [])


def test_an_error_inside_the_block_comes_out(opener: Opener):
    with pytest.raises(RuntimeError, match="mine"), opener(ManualClock(), "1"):
        raise RuntimeError("mine")
