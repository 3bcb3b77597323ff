"""Claims about recording and reading back."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.errors import BadInput, BadRecording, RecordingFailed
from taxel.recordings.manifest import Manifest, from_record, to_record
from taxel.recordings.part_file import part_path
from taxel.recordings.reader import (
    iterate_blocks,
    iterate_samples,
    list_recordings,
    read_manifest,
    read_recording,
)
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SlipNote, Validity

ARRAYS = ("values", "counter", "device_s", "arrival_s", "fitted_s", "validity")


def assert_same(left: Samples, right: Samples) -> None:
    """Bit for bit, so that NaN and -0.0 count too."""
    for name in ARRAYS:
        assert getattr(left, name).tobytes() == getattr(right, name).tobytes(), name
        assert getattr(left, name).dtype == getattr(right, name).dtype, name


def test_scans_come_back_bit_for_bit(tmp_path, manifest, numbered):
    """Values, times, counters and flags survive, also NaN, infinity and -0.0."""
    samples = numbered(0, 1000)
    samples.values[3] = [np.nan, np.inf, -np.inf, -0.0]
    samples.validity[3] = [Validity.NOT_FINITE | Validity.SATURATED, 16, 16, 255]
    samples.device_s[5] = np.nan
    samples.arrival_s[6] = np.nan
    samples.counter[7] = -1
    with Recorder(tmp_path / "a.mcap", manifest) as recorder:
        recorder.write(samples)

    assert_same(read_recording(tmp_path / "a.mcap").samples, samples)


def test_manifest_and_marks_come_back(finished, manifest):
    """What the recording is, and its marks, survive unchanged."""
    recording = read_recording(finished)

    assert recording.manifest == manifest == read_manifest(finished)
    assert recording.marks == [Mark(start_s=50.0, end_s=50.05, labels={"grasp": "stable"})]


def test_no_scan_is_lost_or_repeated_over_many_small_writes(tmp_path, manifest, numbered):
    """Channel 0 counts on from 0 to the end, however the writes are cut."""
    sizes = np.random.default_rng(1).integers(0, 40, 300)
    first = 0
    with Recorder(tmp_path / "a.mcap", manifest) as recorder:
        for size in sizes:
            recorder.write(numbered(first, int(size)))
            first += int(size)

    samples = read_recording(tmp_path / "a.mcap").samples
    np.testing.assert_array_equal(samples.values[:, 0], np.arange(sizes.sum()))


def test_blocks_hold_the_same_scans_as_the_whole(finished):
    """Reading in blocks of any size gives what reading at once gives."""
    whole = read_recording(finished).samples
    for block_scans in (1, 7, 20, 64, 10_000):
        blocks = list(iterate_samples(finished, block_scans))
        assert_same(Samples.join(blocks), whole)
        assert {len(block) for block in blocks[:-1]} <= {block_scans}
    assert sum(len(block.marks) for block in iterate_blocks(finished)) == 1


def test_statistics_count_what_the_device_says_was_lost(tmp_path, manifest, numbered):
    """The ledger has the measured rate and the scans that the counter skipped."""
    with Recorder(tmp_path / "a.mcap", manifest) as recorder:
        recorder.write(numbered(0, 100))
        recorder.write(numbered(130, 100))

    statistics = read_recording(tmp_path / "a.mcap").statistics
    assert statistics["scans"] == 200
    assert statistics["lost_scans"] == 30
    assert statistics["counter_gaps"] == 1
    assert statistics["rate_hz"] == pytest.approx(199 / 0.229)
    assert statistics["ended"] == "cleanly"


def test_the_file_has_its_name_only_when_it_is_complete(tmp_path, manifest, numbered):
    """While it runs there is NAME.mcap.part, afterwards NAME.mcap alone."""
    path = tmp_path / "a.mcap"
    with Recorder(path, manifest) as recorder:
        recorder.write(numbered(0, 5))
        assert part_path(path).exists()
        assert not path.exists()
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]


def test_an_error_in_the_block_still_completes_the_file(tmp_path, manifest, numbered):
    """What was measured before the error is kept, and the file says how it ended."""

    def record_and_fail() -> None:
        with Recorder(tmp_path / "a.mcap", manifest) as recorder:
            recorder.write(numbered(0, 5))
            recorder.write(numbered(5, 5, 3))

    with pytest.raises(BadInput):
        record_and_fail()
    recording = read_recording(tmp_path / "a.mcap")
    assert len(recording.samples) == 5
    assert recording.statistics["ended"] == "cut short: BadInput"


def test_an_error_before_the_first_scan_leaves_no_file(tmp_path, manifest):
    """Nothing was measured, so nothing is kept."""
    with pytest.raises(ZeroDivisionError), Recorder(tmp_path / "a.mcap", manifest):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_discard_leaves_no_file(tmp_path, manifest, numbered):
    """A half that is worth nothing is removed."""
    recorder = Recorder(tmp_path / "a.mcap", manifest)
    recorder.write(numbered(0, 5))
    recorder.discard()
    assert list(tmp_path.iterdir()) == []


def test_an_existing_recording_is_not_replaced_unasked(finished, manifest):
    """Neither a finished nor an unfinished recording is lost by a second run."""
    before = finished.read_bytes()
    with pytest.raises(BadInput, match="--overwrite"):
        Recorder(finished, manifest)
    assert finished.read_bytes() == before
    finished.rename(part_path(finished))
    with pytest.raises(BadInput, match="taxel recover"):
        Recorder(finished, manifest)
    with Recorder(finished, manifest, overwrite=True):
        pass
    assert len(read_recording(finished).samples) == 0


def test_scans_that_do_not_fit_are_refused(tmp_path, manifest, numbered):
    """Another number of channels, or no fitted time, is an error at once."""
    with Recorder(tmp_path / "a.mcap", manifest) as recorder:
        with pytest.raises(BadInput, match="4 channels"):
            recorder.write(numbered(0, 5, 3))
        timeless = replace(numbered(0, 5), fitted_s=np.full(5, np.nan))
        with pytest.raises(BadInput, match="finite fitted time"):
            recorder.write(timeless)


def test_what_cannot_be_written_is_as_loud_as_a_full_disk(tmp_path, manifest):
    """Nothing that goes wrong in the writer's thread goes unnoticed."""
    recorder = Recorder(tmp_path / "a.mcap", manifest)
    with pytest.raises(BadInput, match="finite"):
        recorder.mark(Mark(start_s=np.nan, end_s=1.0, labels={}))
    recorder.slip(SlipNote(time_s=0.0, who="left", values={"slip_mm": object()}))  # type: ignore[dict-item]
    with pytest.raises(RecordingFailed, match="TypeError"):
        recorder.flush()
    with pytest.raises(RecordingFailed, match="TypeError"):
        recorder.close()


def test_a_closed_recorder_takes_nothing(tmp_path, manifest, numbered):
    """Scans handed over after the end are an error, not silence; closing twice is none."""
    recorder = Recorder(tmp_path / "a.mcap", manifest)
    recorder.close()
    recorder.close()
    with pytest.raises(RecordingFailed, match="closed"):
        recorder.write(numbered(0, 5))


def test_times_before_1970_do_not_break_the_file(tmp_path, manifest, numbered):
    """Imported device times may be negative; MCAP's stamps are then 0, taxel's are exact."""
    samples = numbered(0, 10)
    samples = replace(samples, fitted_s=samples.fitted_s - 100.0)
    with Recorder(tmp_path / "a.mcap", replace(manifest, wall_anchor_ns=0)) as recorder:
        recorder.write(samples)
    assert_same(read_recording(tmp_path / "a.mcap").samples, samples)


def test_a_manifest_with_a_changed_letter_is_refused(manifest):
    """The manifest carries its own check sum."""
    pairs = to_record(manifest)
    assert from_record(pairs) == manifest
    with pytest.raises(BadRecording, match="damaged manifest"):
        from_record(pairs | {"labels": pairs["labels"].replace("sphere", "sphera")})


def test_started_now_anchors_the_scans_own_clock(manifest):
    """A simulator's clock and the host's get the same wall time for the same moment."""
    host = Manifest.started_now(manifest.sensor)
    simulated = Manifest.started_now(manifest.sensor, now_s=1000.0)
    import time

    ours = simulated.wall_anchor_ns + 1_000_000_000_000
    theirs = host.wall_anchor_ns + time.monotonic_ns()
    assert abs(ours - theirs) < 1_000_000_000


def test_a_missing_or_foreign_file_is_one_plain_line(tmp_path):
    """Each is refused with what to do about it."""
    (tmp_path / "text.mcap").write_text("hello")
    for name, words in (("gone.mcap", "check the path"), ("text.mcap", "taxel import")):
        with pytest.raises(BadRecording, match=words) as caught:
            read_recording(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_an_unfinished_recording_names_the_command_that_saves_it(finished):
    """Asking for NAME.mcap while only NAME.mcap.part exists says: taxel recover."""
    finished.rename(part_path(finished))
    with pytest.raises(BadRecording, match="taxel recover"):
        read_recording(finished)
    with pytest.raises(BadRecording, match="taxel recover"):
        list_recordings(finished.parent)


def test_a_folder_lists_its_recordings_by_name(finished, tmp_path):
    """A data set is a folder; its order does not depend on the disk's."""
    (tmp_path / "b.mcap").write_bytes(finished.read_bytes())
    (tmp_path / "a.mcap").write_bytes(finished.read_bytes())
    assert [path.name for path in list_recordings(tmp_path)] == [
        "a.mcap",
        "b.mcap",
        "finished.mcap",
    ]
    assert list_recordings(finished) == [finished]
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadRecording, match="taxel simulate"):
        list_recordings(tmp_path / "empty")


def test_what_macos_leaves_beside_a_recording_is_no_recording(finished):
    beside = finished.with_name(f"._{finished.name}")
    beside.write_bytes(b"\0\5\x16\7" + bytes(78))
    beside.with_name(f"._{finished.stem}-2.mcap.part").write_bytes(b"\0\5\x16\7")
    assert list_recordings(finished.parent) == [finished]
