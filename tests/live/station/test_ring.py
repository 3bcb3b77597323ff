"""The ring of messages in shared memory: nothing twice, nothing torn, every loss counted."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.errors import BadInput
from taxel.live.station import ring as module
from taxel.live.station.packets import pack, unpack
from taxel.live.station.ring import Ring, RingReader, RingWriter, bytes_of
from taxel.live.station.shared import create_shared
from taxel.signals import Frame, Mark, Samples


@pytest.fixture
def ring() -> Iterator[Ring]:
    with Ring(4096) as made:
        yield made


def test_messages_come_once_in_order_also_over_the_rings_end(ring: Ring):
    with RingWriter(ring.name) as writer, RingReader(ring.name) as reader:
        for turn in range(200):
            sent = [bytes([turn % 256]) * (turn % 97) for _ in range(3)]
            for message in sent:
                writer.put(message)
            assert reader.take() == sent
        assert (reader.taken, reader.lost, writer.written) == (600, 0, 600)


def test_a_reader_that_was_overtaken_knows_how_many_it_lost(ring: Ring):
    with RingWriter(ring.name) as writer, RingReader(ring.name) as slow:
        for number in range(1000):
            writer.put(number.to_bytes(4, "little") * 10)
        found = [int.from_bytes(message[:4], "little") for message in slow.take()]
        assert found[-1] == 999
        assert found == list(range(found[0], 1000))
        assert slow.taken + slow.lost == writer.written
        assert slow.lost == found[0]


@pytest.mark.parametrize(("taken", "puts"), [(3, 10), (3, 1000), (10, 10), (0, 10)])
def test_a_reader_that_follows_another_goes_on_at_its_place(ring: Ring, taken: int, puts: int):
    """It gives out what the ring still has of what came since, and counts what is gone."""
    with RingWriter(ring.name) as writer, RingReader(ring.name) as first:
        for number in range(puts):
            writer.put(number.to_bytes(4, "little") * 10)
            if number < taken:
                first.take()
        with RingReader(ring.name) as second:
            second.go_back(first.place, first.lost)
            found = [int.from_bytes(message[:4], "little") for message in second.take()]
            assert found == list(range(taken + second.lost, puts))
            assert (second.lost > 0) == (puts == 1000)
            assert second.taken + second.lost == writer.written
            writer.put(b"next")
            assert second.take() == [b"next"]


def test_a_slow_reader_costs_a_quick_one_nothing(ring: Ring):
    with (
        RingWriter(ring.name) as writer,
        RingReader(ring.name) as slow,
        RingReader(ring.name) as quick,
    ):
        for number in range(500):
            writer.put(number.to_bytes(4, "little") * 25)
            assert quick.take() == [number.to_bytes(4, "little") * 25]
        assert quick.lost == 0
        slow.take()
        assert slow.lost > 0


def test_one_that_attaches_later_begins_with_what_comes_next_or_the_oldest(ring: Ring):
    with RingWriter(ring.name) as writer:
        writer.put(b"before")
        with RingReader(ring.name) as late, RingReader(ring.name, from_oldest=True) as early:
            writer.put(b"after")
            assert late.take() == [b"after"]
            assert early.take() == [b"before", b"after"]


def test_the_newest_is_reported_and_those_before_it_count_as_lost(ring: Ring):
    with RingWriter(ring.name) as writer, RingReader(ring.name) as reader:
        assert reader.newest() is None
        for message in (b"a", b"b", b"c"):
            writer.put(message)
        assert reader.newest() == b"c"
        assert (reader.taken, reader.lost) == (1, 2)


def test_a_message_too_large_is_refused_in_one_line(ring: Ring):
    with RingWriter(ring.name) as writer, pytest.raises(BadInput, match="at most 2048 bytes"):
        writer.put(bytes(2048))


@pytest.mark.parametrize("size", [56, 60, 65])
def test_a_ring_that_is_too_small_or_no_multiple_of_8_is_refused(size: int):
    with pytest.raises(BadInput, match=f"multiple of 8.*{size}"):
        Ring(size)


def test_a_ring_for_which_there_is_no_shared_memory_is_refused_before_it_is_made(
    monkeypatch: pytest.MonkeyPatch,
):
    """Writing to it would end the process by a signal, as in a container with 64 MiB."""
    monkeypatch.setattr(module, "_SHARED", SimpleNamespace(exists=lambda: True))
    monkeypatch.setattr(module.shutil, "disk_usage", lambda _: SimpleNamespace(free=3 * 2**20))
    with Ring(2 * 2**20):
        pass
    with pytest.raises(BadInput, match=r"4 MiB of shared memory.*3 MiB free.*--shm-size"):
        Ring(4 * 2**20)


def test_shared_memory_that_was_closed_is_refused_in_words():
    memory = create_shared(64)
    memory.close()
    memory.unlink()
    with pytest.raises(ValueError, match="got a closed one"):
        bytes_of(memory)


@pytest.mark.parametrize(
    ("at", "value"), [(3, 0x7F), (4, 0xA5), (24, 0x20)], ids=["length", "check sum", "content"]
)
def test_a_message_with_damaged_bytes_is_never_given_out_and_counts_as_lost(
    ring: Ring, at: int, value: int
):
    with RingWriter(ring.name) as writer, RingReader(ring.name) as reader:
        writer.put(b"damaged")
        assert writer._bytes[at] != value
        writer._bytes[at] = value
        assert reader.take() == []
        writer.put(b"whole")
        assert reader.take() == [b"whole"]
        assert (reader.taken, reader.lost) == (1, 1)


def test_a_reader_that_is_overtaken_while_it_reads_gives_out_nothing_torn(
    ring: Ring, monkeypatch: pytest.MonkeyPatch
):
    """The writer goes once around the ring between two bytes of one message."""
    old, new = b"old" * 100, b"new" * 100
    with RingWriter(ring.name) as writer, RingReader(ring.name) as reader:
        writer.put(old)
        read = reader._read

        def slow(position: int, length: int) -> bytes:
            if writer.written == 1:
                for _ in range(20):
                    writer.put(new)
            return read(position, length)

        monkeypatch.setattr(reader, "_read", slow)
        found = reader.take()
        assert set(found) == {new}
        assert reader.taken + reader.lost == writer.written == 21


def _write_for_ever(name: str) -> None:
    with RingWriter(name) as writer:
        number = 0
        while True:
            content = number.to_bytes(8, "little")
            writer.put(content * (1 + number % 60))
            number += 1


@pytest.mark.data
def test_a_writer_killed_at_any_moment_leaves_nothing_torn_and_its_follower_goes_on():
    context = multiprocessing.get_context("spawn")
    with Ring(65536) as ring, RingReader(ring.name) as reader:
        for _ in range(3):
            child = context.Process(target=_write_for_ever, args=(ring.name,), daemon=True)
            child.start()
            before = reader.taken
            while reader.taken < before + 5_000:
                for message in reader.take():
                    assert message == message[:8] * (len(message) // 8)
            assert child.pid is not None
            os.kill(child.pid, signal.SIGKILL)
            child.join()
            for message in reader.take():
                assert message == message[:8] * (len(message) // 8)
        with RingWriter(ring.name) as writer:
            writer.put(b"after")
            assert reader.take() == [b"after"]
            # One message may be under way as its writer dies: counted, then written over.
            assert 0 <= writer.written - reader.taken - reader.lost <= 3


@given(st.lists(st.integers(1, 12), min_size=1, max_size=3), st.integers(0, 6))
@settings(max_examples=30, deadline=None)
def test_scans_frames_marks_and_notes_come_out_as_they_went_in(sizes: list[int], seed: int):
    random = np.random.default_rng(seed)
    for n in sizes:
        samples = Samples(
            values=random.normal(size=(n, 12)).astype(np.float32),
            counter=np.arange(n),
            device_s=random.random(n),
            arrival_s=random.random(n),
            fitted_s=random.random(n),
            validity=random.integers(0, 31, (n, 12)).astype(np.uint8),
        )
        back = unpack(pack(samples))
        assert isinstance(back, Samples)
        for name in ("values", "counter", "device_s", "arrival_s", "fitted_s", "validity"):
            np.testing.assert_array_equal(getattr(back, name), getattr(samples, name))
    frame = Frame(
        camera=1,
        jpeg=bytes(sizes),
        counter=seed,
        device_s=float("nan"),
        arrival_s=2.0,
        fitted_s=1.0,
    )
    again = unpack(pack(frame))
    assert isinstance(again, Frame)
    assert (again.camera, again.jpeg, again.counter, again.fitted_s) == (1, bytes(sizes), seed, 1.0)
    mark = Mark(start_s=1.0, end_s=2.0, labels={"shape": "cup"}, groups={"session": "ü"})
    assert unpack(pack(mark)) == mark
    assert unpack(pack({"state": "STABLE", "p": None})) == {"state": "STABLE", "p": None}
