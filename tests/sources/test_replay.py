"""Claims about replay://: recorded spacing, gaps and marks come back; memory stays constant."""

from pathlib import Path

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.errors import BadRecording
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo, Validity
from taxel.sources.opening import open_source

INFO = SensorInfo(name="t", channels=("n", "x"), units=("1", "V"), rate_hz=100.0)


def scans(time_s: np.ndarray, counter: np.ndarray | None = None) -> Samples:
    values = np.stack([np.arange(len(time_s)), np.zeros(len(time_s))], axis=1)
    plain = Samples.from_values(values, time_s)
    return Samples(
        values=plain.values,
        counter=plain.counter if counter is None else counter,
        device_s=np.full(len(time_s), np.nan),
        arrival_s=time_s + 0.004,
        fitted_s=time_s,
        validity=plain.validity,
    )


def record(path: Path, parts: list[Samples], marks: list[Mark]) -> str:
    with Recorder(path, Manifest(sensor=INFO)) as recorder:
        for mark in marks[:1]:
            recorder.mark(mark)
            recorder.flush()
        for part in parts:
            recorder.write(part)
            recorder.flush()
        for mark in marks[1:]:
            recorder.mark(mark)
    return str(path)


def read_all(url: str, clock: ManualClock) -> tuple[Samples, list[Mark]]:
    parts, marks = [], []
    with open_source(url, clock) as source:
        while not source.ended:
            parts.append(source.read())
            marks += source.marks()
        marks += source.marks()
    return Samples.join(parts), marks


def test_spacing_gaps_and_flags_come_back_exactly(tmp_path):
    """Irregular times, a jump of the counter and a missing value are kept as recorded."""
    rng = np.random.default_rng(0)
    time_s = 5e8 + np.cumsum(rng.integers(1, 400, 300)) / 2**14
    counter = np.arange(300, dtype=np.int64)
    counter[120:] += 7
    samples = scans(time_s, counter)
    samples.validity[40, 1] = Validity.MISSING
    path = record(tmp_path / "a.mcap", [samples[:100], samples[100:250], samples[250:]], [])
    replayed, _ = read_all(path, ManualClock(2.0**20))
    np.testing.assert_array_equal(np.diff(replayed.fitted_s), np.diff(time_s))
    np.testing.assert_allclose(replayed.arrival_s - replayed.fitted_s, 0.004, atol=1e-6)
    np.testing.assert_array_equal(replayed.counter, counter)
    np.testing.assert_array_equal(replayed.validity, samples.validity)
    np.testing.assert_array_equal(replayed.values, samples.values)


def test_marks_lie_where_they_lay_among_the_scans(tmp_path):
    """Also one that stands in the file before any scan, and one that ends after the last."""
    time_s = 70.0 + np.arange(200) / 100
    marks = [
        Mark(start_s=70.1, end_s=70.2, labels={"k": "first"}),
        Mark(start_s=71.0, end_s=71.5, labels={"k": "second"}),
        Mark(start_s=71.6, end_s=99.0, labels={"k": "beyond"}),
    ]
    path = record(tmp_path / "a.mcap", [scans(time_s)], marks)
    _, replayed = read_all(path, ManualClock(1000.0))
    assert [mark.labels["k"] for mark in replayed] == ["first", "second", "beyond"]
    for before, after in zip(marks, replayed, strict=True):
        assert after.start_s - 1000.0 == pytest.approx(before.start_s - 70.0)
        assert after.end_s - after.start_s == pytest.approx(before.end_s - before.start_s)


def test_a_mark_that_ends_late_does_not_hold_up_the_next(tmp_path):
    time_s = 1.0 + np.arange(300) / 100
    long = Mark(start_s=1.0, end_s=3.5, labels={"k": "long"})
    short = Mark(start_s=1.2, end_s=1.4, labels={"k": "short"})
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=INFO)) as recorder:
        recorder.mark(long)
        recorder.mark(short)
        recorder.flush()
        recorder.write(scans(time_s))
    clock = ManualClock()
    with open_source(str(tmp_path / "a.mcap"), clock) as source:
        clock.advance(1.0)
        source.read()
        assert [mark.labels["k"] for mark in source.marks()] == ["short"]


def test_a_recordings_labels_hold_for_its_marks_as_in_training(tmp_path):
    labelled = Manifest(sensor=INFO, labels={"k": "all", "sign": "A"}, groups={"session": "3"})
    with Recorder(tmp_path / "a.mcap", labelled) as recorder:
        recorder.write(scans(5.0 + np.arange(100) / 100))
        recorder.mark(Mark(start_s=5.1, end_s=5.2, labels={"k": "own"}, groups={"grasp": "1"}))
    _, marks = read_all(str(tmp_path / "a.mcap"), ManualClock())
    assert [dict(mark.labels) for mark in marks] == [{"k": "own", "sign": "A"}]
    assert dict(marks[0].groups) == {"session": "3", "grasp": "1"}


def test_a_labelled_recording_without_marks_is_one_mark(tmp_path):
    """From its first scan to its last, given with the last."""
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=INFO, labels={"sign": "A"})) as recorder:
        recorder.write(scans(5.0 + np.arange(101) / 100))
    _, marks = read_all(str(tmp_path / "a.mcap"), ManualClock(50.0))
    assert [(mark.start_s, mark.end_s, dict(mark.labels)) for mark in marks] == [
        (50.0, pytest.approx(51.0), {"sign": "A"})
    ]


def test_it_holds_one_chunk_at_a_time(tmp_path):
    """However long the recording: at full speed a read gives at most what a chunk holds."""
    time_s = np.arange(4000) / 100
    whole = scans(time_s)
    path = record(tmp_path / "a.mcap", [whole[i : i + 50] for i in range(0, 4000, 50)], [])
    with open_source(f"replay://{path}?speed=max", ManualClock()) as source:
        sizes = []
        while not source.ended:
            sizes.append(len(source.read()))
    assert (sum(sizes), max(sizes)) == (4000, 50)


@pytest.mark.parametrize("by_s", [-3600.0, 3600.0])
def test_a_clock_that_jumps_brings_no_mark_long_before_its_scans(tmp_path, by_s):
    """After a jump back all that followed was held, and all of its marks came at once."""
    time_s = 1e5 + np.arange(6000) / 100
    time_s[3000:] += by_s
    whole = scans(time_s)
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=INFO)) as recorder:
        for at in range(0, 6000, 200):
            recorder.write(whole[at : at + 200])
            recorder.flush()
            recorder.mark(Mark(start_s=time_s[at], end_s=time_s[at + 199], labels={"n": str(at)}))
    count, found = 0, {}
    with open_source(f"{tmp_path / 'a.mcap'}?speed=max", ManualClock()) as source:
        while not source.ended:
            count += len(source.read())
            found |= {int(mark.labels["n"]): count for mark in source.marks()}
    assert count == 6000
    assert len(found) == 30
    assert min(came - at for at, came in found.items()) >= -500


def test_a_pause_in_the_recording_is_a_silence(tmp_path):
    """Ten seconds without scans are ten seconds of empty reads."""
    time_s = np.r_[np.arange(10) / 100, 10.0 + np.arange(10) / 100]
    clock = ManualClock()
    with open_source(record(tmp_path / "a.mcap", [scans(time_s)], []), clock) as source:
        lengths = [len(source.read(0.5)) for _ in range(39)]
    assert sum(lengths) == 20
    assert lengths.count(0) == 19


def test_an_empty_recording_has_ended(tmp_path):
    with open_source(record(tmp_path / "a.mcap", [], []), ManualClock()) as source:
        assert source.ended
        assert source.read(1.0).values.shape == (0, 2)


def test_damage_is_raised_when_it_is_reached(tmp_path):
    """The sound half is replayed; then one line says what to do."""
    time_s = np.arange(2000) / 100
    whole = scans(time_s)
    path = record(tmp_path / "a.mcap", [whole[i : i + 500] for i in range(0, 2000, 500)], [])
    data = bytearray(Path(path).read_bytes())
    data[len(data) * 6 // 10] ^= 0xFF
    Path(path).write_bytes(data)
    got = []

    def read_on() -> None:
        with open_source(f"{path}?speed=max", ManualClock()) as source:
            while not source.ended:
                got.append(len(source.read()))

    with pytest.raises(BadRecording, match="recover"):
        read_on()
    assert sum(got) == 1000
