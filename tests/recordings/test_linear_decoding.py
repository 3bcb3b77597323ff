"""Decoding costs what a chunk's size says, however its messages are mixed: counted, not timed."""

import numpy as np
import pytest

from taxel.recordings import mark_layout, scan_layout
from taxel.recordings.chunk_content import decode_chunk
from taxel.signals import Mark, Samples

CHANNELS = 4


def scans(count: int) -> list[bytes]:
    samples = Samples.from_values(np.ones((count, CHANNELS)), np.arange(count) * 0.001, None)
    return [record.tobytes() for record in scan_layout.encode_scans(samples, 0, 0)]


def mark(number: int) -> bytes:
    whole = Mark(start_s=number * 0.001, end_s=number * 0.001, labels={})
    return mark_layout.encode_mark(whole, number, 0)[1]


def alternating(count: int, run: int) -> bytes:
    """A chunk of `count` scans with a mark after each `run` of them."""
    parts = scans(count)
    return b"".join(part + (mark(i) if (i + 1) % run == 0 else b"") for i, part in enumerate(parts))


class Counted(np.ndarray):
    """Counts the records whose fields are looked at."""

    looked_at = 0

    def __getitem__(self, key):
        Counted.looked_at += len(self) if key == "opcode" else 0
        return super().__getitem__(key)


class Content(bytes):
    """Counts the bytes that are cut out, and the places that are compared."""

    cut = compared = 0

    def __getitem__(self, key):
        found = super().__getitem__(key)
        Content.cut += len(found) if isinstance(key, slice) else 0
        return found

    def startswith(self, *given):
        Content.compared += 1
        return super().startswith(*given)


@pytest.mark.parametrize("run", [1, 3, 100, 10_000])
def test_the_work_of_a_chunk_grows_with_its_scans_alone(run: int, monkeypatch: pytest.MonkeyPatch):
    """Each scan is looked at a few times and copied once, among n as among 4n."""
    frombuffer = np.frombuffer
    monkeypatch.setattr(np, "frombuffer", lambda *given: frombuffer(*given).view(Counted))
    for count in (1000, 2000, 4000):
        content = Content(alternating(count, run))
        Counted.looked_at = Content.cut = Content.compared = 0
        found = decode_chunk(content, CHANNELS, 0)
        assert sum(map(len, found.runs)) == count
        assert len(found.marks) == count // run
        assert Counted.looked_at + Content.compared <= 8 * count
        assert Content.cut <= len(content)


@pytest.mark.parametrize("run", [1, 7, 8, 9, 24, 1000])
def test_runs_end_where_they_end(run: int):
    found = decode_chunk(alternating(2 * run + 1, run), CHANNELS, 0)
    assert len(found.marks) == (2 * run + 1) // run
    assert found.samples(CHANNELS).fitted_s.tolist() == pytest.approx(
        [0.001 * i for i in range(2 * run + 1)]
    )


def test_a_scan_of_another_layout_is_refused_where_it_stands():
    content = b"".join([*scans(20), mark(0), scans(1)[0][:40] + b"\x09" + scans(1)[0][41:]])
    broken = bytearray(content)
    broken[-len(scans(1)[0]) + 31] ^= 1  # the CDR head
    with pytest.raises(ValueError, match="not laid out for 4 channels"):
        decode_chunk(bytes(broken), CHANNELS, 0)
