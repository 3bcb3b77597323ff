"""How the walk over a damaged recording searches, counts and gives up (0049)."""

import math
import mmap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.opcode import Opcode

from taxel import held
from taxel.errors import BadRecording
from taxel.recordings import recovery
from taxel.recordings.manifest import Manifest
from taxel.recordings.mcap_file import MAGIC, RECORD_HEAD
from taxel.recordings.recovery import recover
from taxel.recordings.recovery_report import RecoveryReport
from taxel.recordings.scan_layout import FURTHEST_S
from taxel.recordings.walk import Damaged
from taxel.signals import CameraInfo, SensorInfo

SIGN = b"\5\0\0\0taxel"


@contextmanager
def mapped(path: Path, content: bytes) -> Iterator[mmap.mmap]:
    path.write_bytes(content)
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as found:
        yield found


class Spent:
    """In place of the limit of effort: keeps what was spent."""

    def __init__(self) -> None:
        self.counts: list[int] = []

    def spend(self, count: int) -> None:
        self.counts.append(count)


def test_a_report_begins_with_nothing():
    assert RecoveryReport().as_dict() == {
        "scans": 0, "marks": 0, "frames": 0, "chunks": 0, "damaged_stretches": 0,
        "bytes_skipped": 0, "time_lost_s": 0.0, "was_complete": False, "notes": [],
    }  # fmt: skip


def test_memory_is_that_of_32_mib_and_a_manifest_stands_within_64_of_the_ends():
    assert (recovery._PART, recovery._MANIFEST_WITHIN) == (32 * 2**20, 64 * 2**20)


@pytest.mark.parametrize("size", [0, 1000])
def test_half_a_gibibyte_and_eight_times_the_file_may_be_looked_at_in_vain(size: int):
    effort = recovery._Effort(Path("made-to-last.mcap"), size)
    effort.spend(512 * 2**20)
    effort.spend(8 * size)
    with pytest.raises(BadRecording, match=r"made-to-last\.mcap, full of heads of chunks"):
        effort.spend(1)


@pytest.mark.parametrize(("rate_hz", "lost_s"), [(10.0, 0.4), (0.0, 0.5)])
def test_lost_time_is_the_gap_less_the_usual_step(rate_hz: float, lost_s: float):
    gaps = recovery._Gaps(rate_hz)
    gaps.opened()
    gaps.continued([2.0, 1.0])
    assert gaps.lost_s == 0.0  # nothing is known of the time before
    gaps.continued([9.0])
    assert gaps.lost_s == 0.0  # a pause, and nothing damaged in it
    gaps.opened()
    gaps.continued([])
    gaps.continued([9.5, 9.6])
    assert gaps.lost_s == pytest.approx(lost_s)
    gaps.opened()
    gaps.continued([3.0])
    assert gaps.lost_s == pytest.approx(lost_s)  # a clock that was set back lost nothing


class Kept:
    """In place of a recorder."""

    def __init__(self) -> None:
        self.slips: list[object] = []
        self.frames: list[object] = []

    def slip(self, note: object) -> None:
        self.slips.append(note)

    def frame(self, frame: object) -> None:
        self.frames.append(frame)


def copied(monkeypatch: pytest.MonkeyPatch, decode: object) -> tuple[RecoveryReport, Kept]:
    monkeypatch.setattr(recovery, "decode_chunk", decode)
    camera = CameraInfo(name="left", width=8, height=8, rate_hz=60.0)
    sensor = SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)
    report, kept = RecoveryReport(), Kept()
    manifest = Manifest(sensor=sensor, cameras=(camera,))
    recovery._copy_chunk(b"1234567", manifest, kept, report, recovery._Gaps(60.0))  # type: ignore[arg-type]
    return report, kept


def test_frames_at_impossible_times_are_left_out_and_slips_are_kept(monkeypatch):
    times = [FURTHEST_S, -FURTHEST_S, 2 * FURTHEST_S, math.nan, 0.5]
    frames = [SimpleNamespace(fitted_s=time_s) for time_s in times]
    found = SimpleNamespace(runs=[], marks=[], slips=["a", "b"], frames=frames)
    report, kept = copied(monkeypatch, lambda *_: found)

    assert kept.slips == ["a", "b"]
    assert [frame.fitted_s for frame in kept.frames] == [FURTHEST_S, -FURTHEST_S, 0.5]
    assert (report.frames, report.chunks, report.damaged_stretches) == (3, 1, 0)


def test_a_sound_chunk_of_another_layout_counts_as_damaged(monkeypatch):
    def refuse(*_: object) -> None:
        raise ValueError("three channels")

    report, kept = copied(monkeypatch, refuse)

    assert (report.chunks, report.damaged_stretches, report.bytes_skipped) == (0, 1, 7)
    assert report.notes == ["a chunk is sound but not taxel's: three channels"]
    assert kept.frames == []


@pytest.mark.parametrize("at", [0, 5, 15, 16, 17, 31, 32, 40])
def test_a_sign_is_found_wherever_a_part_ends(at: int, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(recovery, "_PART", 16)
    content = b"." * at + b"SIGN" + b"." * 9
    with mapped(tmp_path / "a", content) as found:
        assert recovery._find(found, b"SIGN", 0) == at
        assert recovery._find(found, b"SIGN", at) == at
        assert recovery._find(found, b"SIGN", at + 1) == -1
        assert recovery._find(found, b"SIGN", 0, at + 3) == -1
        assert recovery._find(found, b"SIGN", 0, at + 4) == at
        assert recovery._find(found, b"SIGN", 0, 10_000) == at
        assert {recovery._find(found, b"SIGN", start) for start in range(at + 1)} == {at}


def test_a_payload_is_given_where_its_record_fits_into_the_file(tmp_path: Path):
    record = RECORD_HEAD.pack(7, 3) + b"abc"
    with mapped(tmp_path / "a", record + record) as found:
        for at in (0, len(record)):
            assert recovery._plausible(found, at, 3) == b"abc"
            assert recovery._plausible(found, at, 2) is None
        for at in (-1, -len(record), len(record) + 1, 2 * len(record)):
            assert recovery._plausible(found, at, 100) is None
    with mapped(tmp_path / "a", RECORD_HEAD.pack(7, 0)) as found:
        assert recovery._plausible(found, 0, 0) == b""
    with mapped(tmp_path / "a", (RECORD_HEAD.pack(7, 3) + b"ab")) as found:
        assert recovery._plausible(found, 0, 3) is None


def index(count: int, size: int) -> bytes:
    return b"\1\0" + count.to_bytes(4, "little") + b"\7" * size


@pytest.mark.parametrize(("opcode", "payload", "sound"), [
    (Opcode.MESSAGE_INDEX, index(0, 0), True), (Opcode.MESSAGE_INDEX, index(16, 16), True),
    (Opcode.MESSAGE_INDEX, index(15, 16), False), (Opcode.MESSAGE_INDEX, b"\1\0\0\0\0", False),
    (Opcode.MESSAGE_INDEX, b"", False), (Opcode.DATA_END, bytes(4), True),
    (Opcode.DATA_END, bytes(5), False), (Opcode.FOOTER, bytes(20), True),
    (Opcode.FOOTER, bytes(19), False), (Opcode.SUMMARY_OFFSET, bytes(17), True),
    (Opcode.SUMMARY_OFFSET, bytes(16), False), (Opcode.MESSAGE, bytes(9), False),
    (Opcode.METADATA, bytes(9), True), (Opcode.METADATA, recovery._CHUNK_SIGN, False),
    (Opcode.HEADER, recovery._CHUNK_SIGN, False), (Opcode.CHANNEL, recovery._CHUNK_SIGN, False),
    (Opcode.CHUNK_INDEX, recovery._CHUNK_SIGN, True), (200, bytes(9), False), (0, b"", False),
])  # fmt: skip
def test_a_record_without_a_crc_is_sound_where_its_lengths_agree(opcode, payload, sound):
    assert recovery._sound(opcode, payload) is sound


def test_only_taxel_s_own_metadata_hold_a_manifest():
    for name in (b"aaaaa", b"zzzzz"):
        with pytest.raises(Damaged, match="another metadata record"):
            recovery._metadata_pairs(b"\5\0\0\0" + name + bytes(4))
    assert recovery._metadata_pairs(SIGN + bytes(4)) == {}


def test_false_copies_of_the_manifest_cost_what_was_looked_at_and_hide_no_true_one(
    finished, tmp_path: Path
):
    """One sign by itself, one behind a head that promises 30 bytes; then the recording, cut short
    and without its second copy."""
    content = finished.read_bytes()
    content = content[: content.index(recovery._CHUNK_SIGN)]
    second = content.index(b"sphere", content.index(b"sphere") + 1)
    content = content[:second] + b"SPHERE" + content[second + 6 :]
    false = bytes(200) + SIGN + RECORD_HEAD.pack(Opcode.METADATA, 30) + SIGN + b"\xff" * 100
    effort = Spent()
    with mapped(tmp_path / "a", MAGIC + false + content) as found:
        manifest = recovery._find_manifest(found, tmp_path / "a", effort)  # type: ignore[arg-type]

    assert manifest.labels == {"shape": "sphere"}
    assert effort.counts == [len(SIGN), 30 + len(SIGN)]


def test_a_damaged_chunk_is_looked_at_once(finished, tmp_path: Path):
    content = bytearray(finished.read_bytes())
    start = content.index(recovery._CHUNK_SIGN) - recovery._SIGN_AT
    _, length = RECORD_HEAD.unpack_from(content, start)
    content[start + RECORD_HEAD.size + length // 2] ^= 0xFF
    effort = Spent()
    with mapped(tmp_path / "a", bytes(content)) as found:
        pieces = list(recovery._pieces(found, effort))  # type: ignore[arg-type]

    assert effort.counts == [2 * length]
    assert sum(piece.opcode == Opcode.CHUNK for piece in pieces) == 6
    (damaged,) = [piece for piece in pieces if piece.opcode is None]
    assert damaged.start == start
    assert content[damaged.end] == Opcode.CHUNK


def test_bytes_before_the_first_record_that_are_no_magic_are_counted(finished, tmp_path: Path):
    for first in (0x00, 0xFF):
        content = bytes([first]) + finished.read_bytes()[1:]
        (tmp_path / "a.mcap").write_bytes(content)
        report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap", overwrite=True)
        assert (report.scans, report.damaged_stretches, report.bytes_skipped) == (120, 1, 8)


def test_a_cut_recording_is_not_complete_though_it_ends_with_the_right_bytes(
    finished, tmp_path: Path
):
    content = finished.read_bytes()
    third = [i for i in range(len(content)) if content.startswith(recovery._CHUNK_SIGN, i)][2]
    (tmp_path / "a.mcap").write_bytes(content[: third - recovery._SIGN_AT] + MAGIC)
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")

    assert (report.scans, report.was_complete, report.chunks) == (40, False, 2)


def test_what_follows_a_first_recording_s_end_is_saved_too(finished, tmp_path: Path):
    """Two recordings in one file, as after a copy that went on: both are walked."""
    content = finished.read_bytes()
    (tmp_path / "a.mcap").write_bytes(content + content)
    shares: list[float] = []
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap", progress=shares.append)

    assert (report.scans, report.marks, report.chunks) == (240, 2, 14)
    assert report.was_complete
    assert 0 < shares[0] < shares[-1] <= 1
    assert np.all(np.diff(shares) > 0)


def test_a_first_recording_whose_last_bytes_are_gone_hides_no_second(finished, tmp_path: Path):
    """Its footer is sound; what follows is zeros, as a disk leaves them, and no end of the file."""
    content = finished.read_bytes()
    (tmp_path / "a.mcap").write_bytes(content[: -len(MAGIC)] + bytes(100) + content)
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")

    assert (report.scans, report.marks, report.chunks) == (240, 2, 14)
    assert report.was_complete


def test_what_a_killed_recovery_left_is_in_nobody_s_way(finished, tmp_path: Path):
    killed = tmp_path / ".taxel-b.mcap-killed"
    killed.mkdir()
    (killed / ".owner").write_bytes(held._SIGN + bytes(tmp_path / "b.mcap"))
    (killed / "made.part").write_bytes(b"half")
    assert recover(finished, tmp_path / "b.mcap").scans == 120
    assert not killed.exists()


def test_a_recovery_that_is_interrupted_ends_by_that_and_leaves_nothing(finished, tmp_path: Path):
    def interrupt(share: float) -> None:
        raise KeyboardInterrupt

    folder = tmp_path / "new"
    folder.mkdir()
    with pytest.raises(KeyboardInterrupt):
        recover(finished, folder / "b.mcap", progress=interrupt)
    assert list(folder.iterdir()) == []


def test_one_byte_too_many_before_a_chunk_costs_that_byte_alone(finished, tmp_path: Path):
    content = finished.read_bytes()
    start = content.index(recovery._CHUNK_SIGN) - recovery._SIGN_AT
    (tmp_path / "a.mcap").write_bytes(content[:start] + b"\xff" + content[start:])
    report = recover(tmp_path / "a.mcap", tmp_path / "b.mcap")

    assert (report.scans, report.damaged_stretches, report.bytes_skipped) == (120, 1, 1)
