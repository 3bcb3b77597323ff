"""A reader that sleeps is woken by a put, misses none, and outlives whoever is killed."""

from __future__ import annotations

import errno
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from time import monotonic, sleep, thread_time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.live.station import waking
from taxel.live.station.ring import Ring, RingReader, RingWriter, wait_for_any

CONTEXT = multiprocessing.get_context("spawn")
LONG_S = 20.0
"""A sleep that nobody should see the end of."""
futexes = pytest.mark.skipif(waking._FUTEX_CALL is None, reason="only Linux waits in the kernel")


@pytest.fixture
def rings() -> Iterator[tuple[Ring, Ring]]:
    with Ring(65536) as there, Ring(65536) as back:
        yield there, back


def _answer(there: str, back: str, rounds: int, kernel: bool = True) -> None:
    """Give back each message; sleep for as long as it takes."""
    if not kernel:
        waking._FUTEX_CALL = None
    with RingReader(there, from_oldest=True) as reader, RingWriter(back) as writer:
        taken = 0
        while taken < rounds and reader.wait(LONG_S):
            for message in reader.take():
                writer.put(message)
                taken += 1


@futexes
@pytest.mark.parametrize("looked_at", [1, 2])
def test_a_sleeping_reader_in_another_process_is_woken_by_each_put(
    rings: tuple[Ring, Ring], looked_at: int
):
    """A wake-up that was missed would cost a sleep of 20 s; so would one that was never given."""
    there, back = rings
    rounds = 2000
    child = CONTEXT.Process(target=_answer, args=(there.name, back.name, rounds))
    with Ring(65536) as silent:
        child.start()
        with (
            RingWriter(there.name) as writer,
            RingReader(back.name) as reader,
            RingReader(silent.name) as other,
        ):
            every = (reader, other)[:looked_at]
            for number in range(rounds):
                writer.put(number.to_bytes(4, "little"))
                assert wait_for_any(every, LONG_S), number
                assert reader.take() == [number.to_bytes(4, "little")]
        child.join(LONG_S)
    assert child.exitcode == 0


def _put_for_ever(name: str) -> None:
    with RingWriter(name) as writer:
        while True:
            writer.put(b"x" * 100)


def _sleep_for_ever(name: str, ready: Connection) -> None:
    with RingReader(name) as reader:
        ready.send("here")
        while True:
            reader.wait(LONG_S)
            reader.take()


@futexes
def test_a_writer_killed_at_any_moment_leaves_a_reader_that_sleeps_and_wakes(
    rings: tuple[Ring, Ring],
):
    ring, _ = rings
    with RingReader(ring.name) as reader:
        for _ in range(3):
            child = CONTEXT.Process(target=_put_for_ever, args=(ring.name,), daemon=True)
            child.start()
            before = reader.taken
            while reader.taken < before + 500:
                assert reader.wait(LONG_S)
                reader.take()
            _kill(child.pid, child.join)
            reader.take()
            assert not reader.wait(0.01)
        with RingWriter(ring.name) as writer:
            writer.put(b"after")
            assert reader.wait(LONG_S)
            assert reader.take() == [b"after"]


@futexes
def test_readers_killed_in_their_sleep_cost_writer_and_other_readers_nothing(
    rings: tuple[Ring, Ring],
):
    ring, _ = rings
    for _ in range(3):
        mine, theirs = CONTEXT.Pipe(duplex=False)
        child = CONTEXT.Process(target=_sleep_for_ever, args=(ring.name, theirs), daemon=True)
        child.start()
        assert mine.recv() == "here"
        _kill(child.pid, child.join)
    with RingWriter(ring.name) as writer, RingReader(ring.name) as reader:
        for _ in range(1000):
            writer.put(b"on")
            assert reader.wait(LONG_S)
        assert len(reader.take()) == 1000


def _kill(pid: int | None, join: Callable[[], None]) -> None:
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    join()


def test_a_wait_for_nothing_ends_in_time_and_takes_no_processor(rings: tuple[Ring, Ring]):
    ring, other = rings
    with RingReader(ring.name) as reader, RingReader(other.name) as second:
        for every in ((reader,), (reader, second), ()):
            began_s, worked_s = monotonic(), thread_time()
            assert not wait_for_any(every, 0.1)
            assert monotonic() - began_s >= 0.099
            assert thread_time() - worked_s < 0.05


def test_a_message_that_is_there_is_not_waited_for(rings: tuple[Ring, Ring]):
    with RingWriter(rings[0].name) as writer, RingReader(rings[0].name) as reader:
        writer.put(b"here")
        assert reader.wait(LONG_S)
        assert reader.wait(-1.0)
        assert reader.take() == [b"here"]
        assert not reader.wait(-1.0)


@given(st.lists(st.integers(0, 3), min_size=1, max_size=60))
@settings(max_examples=50, deadline=None)
def test_in_whatever_order_puts_takes_and_waits_come_no_wait_misses_a_message(steps: list[int]):
    """0 puts into one ring, 1 into the other, 2 takes, 3 waits: it ends at once where one is."""
    with (
        Ring(4096) as first,
        Ring(4096) as second,
        RingWriter(first.name) as to_first,
        RingWriter(second.name) as to_second,
        RingReader(first.name) as reader,
        RingReader(second.name) as other,
    ):
        there = 0
        for step in steps:
            if step < 2:
                (to_first, to_second)[step].put(b"message")
                there += 1
            elif step == 2:
                there -= len(reader.take()) + len(other.take())
                assert there == 0
            else:
                assert wait_for_any((reader, other), LONG_S if there else 0.0) is bool(there)


@pytest.mark.parametrize("refused", ["one word", "many words", "every call"])
def test_where_the_kernel_refuses_to_wait_the_word_is_looked_at(
    rings: tuple[Ring, Ring], monkeypatch: pytest.MonkeyPatch, refused: str
):
    """As before Linux 5.16, in a sandbox, or on another system."""
    if refused == "every call":
        monkeypatch.setattr(waking, "_FUTEX_CALL", None)
    name = "_sleep_on_one" if refused == "one word" else "_sleep_on_many"
    monkeypatch.setattr(waking, name, lambda *_: errno.ENOSYS)
    there, back = rings
    kernel = refused != "every call"
    child = CONTEXT.Process(target=_answer, args=(there.name, back.name, 20, kernel))
    child.start()
    with (
        RingWriter(there.name) as writer,
        RingReader(back.name) as reader,
        RingReader(there.name) as other,
    ):
        for _ in range(20):
            writer.put(b"ping")
            other.take()
            every = (reader,) if refused == "one word" else (reader, other)
            assert wait_for_any(every, LONG_S)
            assert reader.take() == [b"ping"]
    child.join(LONG_S)
    assert child.exitcode == 0


def test_a_signal_ends_a_sleep(rings: tuple[Ring, Ring]):
    """A process that sleeps hears at once that it shall end."""
    ring, _ = rings
    mine, theirs = CONTEXT.Pipe(duplex=False)
    child = CONTEXT.Process(target=_sleep_until_asked, args=(ring.name, theirs), daemon=True)
    child.start()
    assert mine.recv() == "here"
    state = f"/proc/{child.pid}/stat"
    until_s = monotonic() + LONG_S
    while os.path.exists(state) and _state(state) != "S" and monotonic() < until_s:
        sleep(0.001)
    began_s = monotonic()
    assert child.pid is not None
    os.kill(child.pid, signal.SIGTERM)
    child.join(LONG_S)
    assert child.exitcode == 0
    assert monotonic() - began_s < LONG_S / 2


def _state(path: str) -> str:
    with open(path) as file:
        return file.read().rpartition(")")[2].split()[0]


def _sleep_until_asked(name: str, ready: Connection) -> None:
    signals: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: signals.append(number))
    with RingReader(name) as reader:
        ready.send("here")
        while not signals:
            reader.wait(LONG_S)


def test_the_time_of_the_put_comes_with_the_message(rings: tuple[Ring, Ring]):
    with RingWriter(rings[0].name) as writer, RingReader(rings[0].name) as reader:
        before_s = monotonic()
        writer.put(b"one")
        between_s = monotonic()
        writer.put(b"two")
        reader.take(1)
        assert before_s <= reader.put_s <= between_s
        reader.take()
        assert between_s <= reader.put_s <= monotonic()
