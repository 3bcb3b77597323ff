"""Claims about saving what is sound in damaged recordings, and about refusing damaged ones."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from taxel.errors import BadInput, BadRecording
from taxel.recordings.part_file import part_path
from taxel.recordings.reader import list_recordings, read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.recovery_report import RecoveryReport
from taxel.recordings.writer import Recorder

SCANS, SCANS_A_CHUNK = 120, 20


def chunk_spans(path: Path) -> list[tuple[int, int, bool]]:
    """Start, end and "holds scans" of each chunk, by the mcap package's own index."""
    with path.open("rb") as file:
        indexes = make_reader(file).get_summary().chunk_indexes
    return [
        (i.chunk_start_offset, i.chunk_start_offset + i.chunk_length, 1 in i.message_index_offsets)
        for i in sorted(indexes, key=lambda index: index.chunk_start_offset)
    ]


def saved(content: bytes, folder: Path) -> tuple[RecoveryReport, list[int]]:
    """Recover damaged bytes; return the report and the numbers of the saved scans."""
    broken, output = folder / "broken.mcap.part", folder / "saved.mcap"
    broken.write_bytes(content)
    report = recover(broken, output, overwrite=True)
    return report, read_recording(output).samples.values[:, 0].astype(int).tolist()


def test_a_sound_recording_is_recovered_whole(finished, tmp_path):
    """Nothing is lost, nothing counted as damaged, and the manifest and marks are kept."""
    report = recover(finished, tmp_path / "saved.mcap")
    before, after = read_recording(finished), read_recording(tmp_path / "saved.mcap")
    assert (report.scans, report.marks, report.chunks) == (SCANS, 1, 7)
    assert (report.damaged_stretches, report.bytes_skipped, report.time_lost_s) == (0, 0, 0.0)
    assert report.was_complete
    assert after.manifest == before.manifest
    assert after.marks == before.marks
    assert after.samples.values.tobytes() == before.samples.values.tobytes()
    assert after.statistics["ended"] == "recovered"


def test_cut_anywhere_every_complete_chunk_is_saved(finished, tmp_path):
    """At and around each chunk's borders and in between, exactly the whole chunks survive."""
    content, spans = finished.read_bytes(), chunk_spans(finished)
    borders = [
        border + by for start, end, _ in spans for border in (start, end) for by in (-1, 0, 1)
    ]
    for cut in sorted({*borders, *range(spans[0][0], len(content), 257)}):
        whole = sum(holds and end <= cut for _, end, holds in spans)
        _, numbers = saved(content[:cut], tmp_path)
        assert numbers == list(range(whole * SCANS_A_CHUNK)), cut


def test_cut_within_the_manifest_there_is_nothing_to_save(finished, tmp_path):
    """Without a manifest the values mean nothing: one plain line and no output."""
    content = finished.read_bytes()
    head = content[: content.index(b"sphere")]
    (tmp_path / "head.mcap").write_bytes(head)
    with pytest.raises(BadRecording, match="manifest"):
        recover(tmp_path / "head.mcap", tmp_path / "saved.mcap")
    assert not (tmp_path / "saved.mcap").exists()


@pytest.mark.slow
def test_a_flipped_bit_loses_at_most_its_own_chunk(finished, tmp_path):
    """Wherever it is: in a chunk that chunk is lost, anywhere else nothing is."""
    content, spans = finished.read_bytes(), chunk_spans(finished)
    for at in range(0, len(content), 61):
        broken = bytearray(content)
        broken[at] ^= 1 << (at % 8)
        _, numbers = saved(bytes(broken), tmp_path)
        lost = set(range(SCANS)) - set(numbers)
        inside = [i for i, (start, end, holds) in enumerate(spans) if start <= at < end and holds]
        allowed = {n for i in inside for n in range(i * SCANS_A_CHUNK, (i + 1) * SCANS_A_CHUNK)}
        assert lost <= allowed, at
        assert numbers == sorted(set(numbers)), at


def test_a_damaged_chunk_is_counted_in_seconds_and_bytes(finished, tmp_path):
    """Twenty scans at 1 kHz in the middle are 20 ms."""
    start, end, _ = chunk_spans(finished)[2]
    broken = bytearray(finished.read_bytes())
    broken[(start + end) // 2] ^= 0xFF
    report, numbers = saved(bytes(broken), tmp_path)
    assert numbers == [*range(40), *range(60, 120)]
    assert report.time_lost_s == pytest.approx(0.020)
    assert report.damaged_stretches == 1
    assert report.bytes_skipped >= end - start


def test_a_flipped_bit_anywhere_is_refused_by_the_reader(finished, tmp_path):
    """No damaged value is ever handed on as a good one."""
    content = finished.read_bytes()
    broken_path = tmp_path / "broken.mcap"
    for at in range(0, len(content), 17):
        broken = bytearray(content)
        broken[at] ^= 1 << (at % 8)
        broken_path.write_bytes(broken)
        with pytest.raises(BadRecording) as caught:
            read_recording(broken_path)
        assert "\n" not in str(caught.value)


def test_cut_anywhere_the_reader_refuses_and_names_the_mend(finished, tmp_path):
    """A recording that was cut short is never taken for a whole one."""
    content = finished.read_bytes()
    for cut in range(9, len(content), 97):
        (tmp_path / "cut.mcap").write_bytes(content[:cut])
        with pytest.raises(BadRecording, match="taxel recover"):
            read_recording(tmp_path / "cut.mcap")


def test_junk_between_chunks_is_stepped_over(finished, tmp_path):
    """Bytes of another file in the middle cost nothing but themselves."""
    content, spans = finished.read_bytes(), chunk_spans(finished)
    junk = np.random.default_rng(0).bytes(5000)
    at = spans[3][0]
    report, numbers = saved(content[:at] + junk + content[at:], tmp_path)
    assert numbers == list(range(SCANS))
    assert report.bytes_skipped == 5000


def test_both_manifest_copies_stand_before_the_first_scan(finished, tmp_path):
    """Either copy alone is enough, also when the file has no summary."""
    start = chunk_spans(finished)[0][0]
    content = finished.read_bytes()[: chunk_spans(finished)[3][1]]
    copies = [i for i in range(start) if content.startswith(b"sphere", i)]
    assert len(copies) == 2
    for copy in copies:
        broken = bytearray(content)
        broken[copy] ^= 0x01
        assert saved(bytes(broken), tmp_path)[1] == list(range(80))


def test_what_the_recorder_has_flushed_survives_without_a_close(tmp_path, manifest, numbered):
    """The unfinished part holds everything up to the last flush."""
    recorder = Recorder(tmp_path / "a.mcap", manifest)
    recorder.write(numbered(0, 30))
    recorder.flush()
    left_behind = part_path(tmp_path / "a.mcap").read_bytes()
    recorder.discard()
    assert saved(left_behind, tmp_path)[1] == list(range(30))


def test_the_command_that_is_suggested_for_a_part_works(finished):
    """NAME.mcap.part recovers to NAME.mcap itself; the part is left as it was."""
    part = part_path(finished)
    finished.rename(part)
    before = part.read_bytes()
    with pytest.raises(BadRecording, match=f"taxel recover {part} --output {finished}"):
        read_recording(finished)
    assert recover(part, finished).scans == SCANS
    assert part.read_bytes() == before
    assert list_recordings(finished.parent) == [finished]


def test_the_output_is_never_the_input_and_never_replaced_unasked(finished, tmp_path):
    """A recovery cannot make things worse."""
    before = finished.read_bytes()
    with pytest.raises(BadInput, match="another name"):
        recover(finished, finished, overwrite=True)
    (tmp_path / "kept.mcap").write_bytes(b"precious")
    with pytest.raises(BadInput, match="--overwrite"):
        recover(finished, tmp_path / "kept.mcap")
    assert (tmp_path / "kept.mcap").read_bytes() == b"precious"
    assert finished.read_bytes() == before


@pytest.mark.parametrize("content", [b"", b"hello, this is text", b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_one_plain_line(content, tmp_path):
    """Empty files and files of another kind leave no output."""
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(BadRecording) as caught:
        recover(tmp_path / "a.mcap", tmp_path / "saved.mcap")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "saved.mcap").exists()
    with pytest.raises(BadRecording, match="check the path"):
        recover(tmp_path / "gone.mcap", tmp_path / "saved.mcap")


damage = st.lists(
    st.tuples(
        st.sampled_from(["flip", "cut out", "insert", "repeat"]),
        st.floats(0, 1),
        st.integers(1, 400),
    ),
    min_size=1,
    max_size=6,
)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(damage=damage)
def test_any_damage_gives_true_scans_or_one_plain_line(damage, finished_content, tmp_path_factory):
    """Whatever happens to the bytes, each saved scan is one that was recorded."""
    content, original = finished_content
    broken = bytearray(content)
    for kind, where, size in damage:
        at = int(where * (len(broken) - 1))
        if kind == "flip":
            broken[at] ^= 1 + size % 255
        elif kind == "cut out":
            del broken[at : at + size]
        elif kind == "insert":
            broken[at:at] = np.random.default_rng(size).bytes(size)
        else:
            broken[at:at] = broken[max(0, at - size) : at]
        broken = broken or bytearray(b"\0")
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "broken.mcap").write_bytes(broken)
    with contextlib.suppress(BadRecording):
        recover(folder / "broken.mcap", folder / "saved.mcap")
    assert {file.name for file in folder.iterdir()} <= {"broken.mcap", "saved.mcap"}
    if not (folder / "saved.mcap").exists():
        return
    for row in read_recording(folder / "saved.mcap").samples.values:
        assert row.tobytes() == original[int(row[0])].tobytes()


@pytest.fixture(scope="module")
def finished_content(tmp_path_factory):
    """The bytes of a recording of three chunks, and its values."""
    from taxel.recordings.manifest import Manifest
    from taxel.signals import Samples, SensorInfo

    values = np.random.default_rng(5).normal(size=(60, 3)).astype(np.float32)
    values[:, 0] = np.arange(60)
    samples = Samples.from_values(values, np.arange(60) / 1000.0)
    sensor = SensorInfo(name="t", channels=("a", "b", "c"), units=("V",) * 3, rate_hz=1000.0)
    path = tmp_path_factory.mktemp("fuzz") / "a.mcap"
    with Recorder(path, Manifest(sensor=sensor)) as recorder:
        for first in (0, 20, 40):
            recorder.write(samples[first : first + 20])
            recorder.flush()
    return path.read_bytes(), values
