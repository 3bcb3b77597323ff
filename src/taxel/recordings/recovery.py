"""Save what is sound in a recording that was cut short or damaged.

A chunk is taken when its lengths agree and its CRC holds, and not otherwise:
nothing is guessed. After a damaged stretch the walk goes on at the next
place where such a chunk begins, so damage costs the chunk it lies in. The
end of a chunk that was cut short is left out, because its CRC covers only
the whole (the recorder closes a chunk every 0.05 s, so this is all that is
lost). Knows nothing about sensors or labels.

Background of our choices: docs/decisions/0004.
"""

from __future__ import annotations

import contextlib
import mmap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from taxel.errors import BadFile, BadInput, BadRecording
from taxel.foreign.files import open_file
from taxel.recordings import scan_layout as layout
from taxel.recordings.chunk_content import decode_chunk
from taxel.recordings.manifest import Manifest, from_record
from taxel.recordings.mcap_file import COMPRESSION, MAGIC, RECORD_HEAD
from taxel.recordings.part_file import hold_to_read
from taxel.recordings.recovery_report import RecoveryReport
from taxel.recordings.walk import (
    LARGEST_CHUNK,
    LARGEST_METADATA,
    Damaged,
    open_chunk,
    parse_channel,
    parse_metadata,
)
from taxel.recordings.whole import whole_file
from taxel.recordings.writer import Recorder
from taxel.signals import Samples

_CHUNK_SIGN = len(COMPRESSION).to_bytes(4, "little") + COMPRESSION.encode()
"""Stands in the head of every chunk that taxel writes …"""
_SIGN_AT = RECORD_HEAD.size + 28
"""… this many bytes after its beginning: opcode, length, two times, size and CRC come first."""
_PART = 32 * 1024 * 1024
"""Bytes that are searched before the system may forget them: a file may be larger than memory."""
_MANIFEST_WITHIN = 2 * _PART
"""A manifest's copies stand at the head and in the summary: so near to the file's ends, bytes."""
_FREE_EFFORT, _EFFORT_A_BYTE = 512 * 1024 * 1024, 8
"""Bytes that may be looked at in vain before a file counts as made to take for ever: damage
costs each chunk once, false heads within one another cost all that follows. Our choice."""


@dataclass(slots=True)
class _Piece:
    """A record that is sound, or bytes that are not."""

    start: int
    end: int
    opcode: int | None
    content: bytes = b""
    """A chunk's uncompressed bytes."""


def recover(
    path: Path,
    output: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[float], None] | None = None,
) -> RecoveryReport:
    """Write a sound recording of all that is sound in a damaged one.

    Args:
        path: The damaged recording, or the .part of one that was not finished.
        output: The new recording; nothing is left there when this raises.
        overwrite: Replace an existing output.
        progress: Called with the share done, 0 to 1.

    Raises:
        BadRecording: It is missing, empty, or being recorded, or both copies of its manifest are
            damaged.
        BadInput: The output exists, or is the damaged file itself.
        RecordingFailed: The disk refused the output.
    """
    if output.exists() and path.exists() and output.samefile(path):
        raise BadInput("another name for the recovered recording", str(output), "change --output")
    if output.exists() and not overwrite:
        raise BadInput(
            "a new file for what is recovered", f"{output}, which exists", "add --overwrite"
        )
    with _mapped(path) as content:
        effort = _Effort(path, len(content))
        manifest = _find_manifest(content, path, effort)
        return _copy(content, manifest, output, effort, progress or (lambda share: None))


def _mapped(path: Path) -> mmap.mmap:
    """Return the file's bytes, of which only those that are looked at are read."""
    try:
        with open_file(path) as file:
            hold_to_read(file, path)  # for as long as it is mapped
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except BadFile as error:
        raise BadRecording("a recording's file", error.got, "name a recording (.mcap)") from error
    except BadRecording:
        raise
    except OSError as error:
        raise BadRecording(
            "a recording that can be opened", f"{path}: {error.strerror}", "check the path"
        ) from error
    except ValueError as error:
        raise BadRecording(
            "a damaged recording", f"the empty file {path}", "nothing can be saved from it"
        ) from error


class _Effort:
    """Counts the bytes that were looked at in vain.

    Args:
        path: The file, for the message.
        size: Its bytes.
    """

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._left = _FREE_EFFORT + _EFFORT_A_BYTE * size

    def spend(self, count: int) -> None:
        """Note so many bytes.

        Raises:
            BadRecording: They are more than damage explains.
        """
        self._left -= count
        if self._left < 0:
            raise BadRecording(
                "a damaged recording", f"{self._path}, full of heads of chunks that are none",
                "nothing can be saved from it",
            )  # fmt: skip


def _copy(
    content: mmap.mmap,
    manifest: Manifest,
    output: Path,
    effort: _Effort,
    progress: Callable[[float], None],
) -> RecoveryReport:
    report = RecoveryReport()
    rates_hz = [camera.rate_hz for camera in manifest.cameras]
    gaps = _Gaps(manifest.sensor.rate_hz if manifest.sensor.channels else max(rates_hz, default=0))
    # Not `output` itself: its .part is the very file that is most often recovered.
    with whole_file(output) as scratch:
        recorder = Recorder(scratch, manifest)
        try:
            for piece in _pieces(content, effort):
                progress(piece.end / len(content))
                if piece.opcode is None:
                    report.damaged_stretches += 1
                    report.bytes_skipped += piece.end - piece.start
                    gaps.opened()
                elif piece.opcode == Opcode.CHUNK:
                    _copy_chunk(piece.content, manifest, recorder, report, gaps)
                elif piece.opcode == Opcode.FOOTER:
                    report.was_complete = content[-len(MAGIC) :] == MAGIC
            report.time_lost_s = gaps.lost_s
            recorder.close("recovered")
        except BaseException:
            recorder.discard()
            raise
    return report


def _copy_chunk(
    content: bytes,
    manifest: Manifest,
    recorder: Recorder,
    report: RecoveryReport,
    gaps: _Gaps,
) -> None:
    """Copy what a sound chunk holds; one of another layout counts as damaged."""
    try:
        sensor, cameras = manifest.sensor, manifest.cameras
        found = decode_chunk(content, len(sensor.channels), len(cameras), manifest.version)
    except ValueError as error:
        report.damaged_stretches += 1
        report.bytes_skipped += len(content)
        report.notes.append(f"a chunk is sound but not taxel's: {error}")
        gaps.opened()
        return
    report.chunks += 1
    if found.runs:
        samples = found.samples(len(manifest.sensor.channels))
        samples = samples[np.abs(samples.fitted_s) <= layout.FURTHEST_S]
        recorder.write(samples)
        report.scans += len(samples)
        gaps.continued(_ends_s(samples))
    for mark in found.marks:
        recorder.mark(mark)
    report.marks += len(found.marks)
    for note in found.slips:
        recorder.slip(note)
    frames = [frame for frame in found.frames if abs(frame.fitted_s) <= layout.FURTHEST_S]
    for frame in frames:
        recorder.frame(frame)
    report.frames += len(frames)
    if not manifest.sensor.channels:
        gaps.continued([frame.fitted_s for frame in frames])


class _Gaps:
    """Adds up the time that damaged stretches took."""

    def __init__(self, rate_hz: float) -> None:
        self._step_s = 1.0 / rate_hz if rate_hz > 0 else 0.0
        self._last_s: float | None = None
        self._open = False
        self.lost_s = 0.0

    def opened(self) -> None:
        """Note that something is missing here."""
        self._open = True

    def continued(self, times_s: list[float]) -> None:
        """Take in the fitted times that follow, seconds."""
        if not times_s:
            return
        if self._open and self._last_s is not None:
            self.lost_s += max(0.0, min(times_s) - self._last_s - self._step_s)
        self._open, self._last_s = False, max(times_s)


def _ends_s(samples: Samples) -> list[float]:
    """Return the first and the last fitted time, where there are scans."""
    return [float(part.fitted_s[0]) for part in (samples[:1], samples[-1:]) if len(part)]


def _find_manifest(content: mmap.mmap, path: Path, effort: _Effort) -> Manifest:
    """Return the first of the manifest's copies whose check sum holds.

    The copies stand in the metadata "taxel" and in the scans' channel record,
    at the head and, in a finished file, again in the summary.
    """
    ends = [(0, _MANIFEST_WITHIN), (max(0, len(content) - _MANIFEST_WITHIN), len(content))]
    for sign, before, parse in (
        (b"\5\0\0\0taxel", 0, _metadata_pairs),
        (layout.scan_topic("").encode(), 8, _channel_pairs),
    ):
        for start, end in ends:
            at = _find(content, sign, start, end)
            while at >= 0:
                payload = _plausible(content, at - before - RECORD_HEAD.size, LARGEST_METADATA)
                with contextlib.suppress(Damaged, BadRecording):
                    return from_record(parse(payload or b""))
                effort.spend(len(payload or b"") + len(sign))
                at = _find(content, sign, at + 1, end)
    raise BadRecording(
        "a recording that taxel wrote",
        f"{path}, in which no copy of taxel's manifest is sound",
        "nothing can be saved from it",
    )


def _metadata_pairs(payload: bytes) -> dict[str, str]:
    name, pairs = parse_metadata(payload)
    if name != "taxel":
        raise Damaged("another metadata record")
    return pairs


def _channel_pairs(payload: bytes) -> dict[str, str]:
    pairs: dict[str, str] = parse_channel(payload).metadata
    return pairs


def _plausible(content: mmap.mmap, at: int, largest: int) -> bytes | None:
    """Return the payload of the record at `at`, if its length can be right."""
    if at < 0 or at + RECORD_HEAD.size > len(content):
        return None
    _, length = RECORD_HEAD.unpack_from(content, at)
    start = at + RECORD_HEAD.size
    if length > largest or start + length > len(content):
        return None
    return content[start : start + length]


def _find(content: mmap.mmap, sign: bytes, start: int, end: int | None = None) -> int:
    """Return where a sign stands next, −1 where nowhere; memory is that of one part."""
    end = len(content) if end is None else min(end, len(content))
    while start < end:
        stop = min(end, start + _PART + len(sign) - 1)
        at = content.find(sign, start, stop)
        if at >= 0:
            return at
        _forget(content, start, stop)
        start += _PART
    return -1


def _forget(content: mmap.mmap, start: int, end: int) -> None:
    """Advise the system that a stretch will not be needed soon."""
    if hasattr(content, "madvise"):
        first = start - start % mmap.PAGESIZE
        content.madvise(mmap.MADV_DONTNEED, first, end - first)


def _pieces(content: mmap.mmap, effort: _Effort) -> Iterator[_Piece]:
    """Yield sound records and, between them, the stretches that are not."""
    at, held = len(MAGIC), 0
    end = len(content)
    if content[:at] != MAGIC:
        yield _Piece(0, at, None)
    while at < end:
        if at - held > _PART:
            _forget(content, held, at)
            held = at
        piece = _record_at(content, at, effort)
        if piece is None:
            following = _next_chunk(content, at + 1, effort)
            yield _Piece(at, end if following is None else following.start, None)
            if following is None:
                return
            piece = following
        yield piece
        at = piece.end
        if piece.opcode == Opcode.FOOTER and content[at : at + len(MAGIC) + 1] == MAGIC:
            return


def _record_at(content: mmap.mmap, at: int, effort: _Effort) -> _Piece | None:
    """Return the record at `at` if it is sound."""
    opcode = content[at]
    if opcode == Opcode.CHUNK:
        return _chunk_at(content, at, effort)
    payload = _plausible(content, at, LARGEST_CHUNK)
    if payload is None or not _sound(opcode, payload):
        return None
    return _Piece(at, at + RECORD_HEAD.size + len(payload), opcode)


def _sound(opcode: int, payload: bytes) -> bool:
    """True where a record without a CRC has lengths that agree with one another.

    A wrong length would make the walk step over sound chunks.
    """
    if opcode == Opcode.MESSAGE_INDEX:
        return len(payload) >= 6 and int.from_bytes(payload[2:6], "little") == len(payload) - 6
    if _CHUNK_SIGN in payload and opcode != Opcode.CHUNK_INDEX:
        return False
    fixed = {Opcode.DATA_END: 4, Opcode.FOOTER: 20, Opcode.SUMMARY_OFFSET: 17}
    if opcode in fixed:
        return len(payload) == fixed[Opcode(opcode)]
    return opcode in set(Opcode) - {Opcode.MESSAGE}


def _chunk_at(content: mmap.mmap, at: int, effort: _Effort) -> _Piece | None:
    payload = _plausible(content, at, LARGEST_CHUNK)
    if payload is None:
        return None
    try:
        opened = open_chunk(payload)
    except Damaged:
        effort.spend(2 * len(payload))  # copied, and opened as far as it went
        return None
    return _Piece(at, at + RECORD_HEAD.size + len(payload), Opcode.CHUNK, opened)


def _next_chunk(content: mmap.mmap, after: int, effort: _Effort) -> _Piece | None:
    """Return the first sound chunk that begins at `after` or later."""
    sign = _find(content, _CHUNK_SIGN, after + _SIGN_AT)
    while sign >= 0:
        start = sign - _SIGN_AT
        if content[start] == Opcode.CHUNK:
            piece = _chunk_at(content, start, effort)
            if piece is not None:
                return piece
        sign = _find(content, _CHUNK_SIGN, sign + 1)
    return None
