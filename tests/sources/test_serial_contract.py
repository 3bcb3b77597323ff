"""`serial://` fulfils the contract of every source, on real ports and in real time.

The same claims as `tests/contracts/test_every_source.py`, whose manual clock no device keeps to.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from taxel.clock import SystemClock
from taxel.signals import Samples
from taxel.sources.boards.emulation import EmulatedBoard, PseudoPort, RunningBoard
from taxel.sources.contract import Source
from taxel.sources.opening import open_source

RATE_HZ = 250
Opener = Callable[[], Source]


@contextlib.contextmanager
def printing(path: Path) -> Iterator[PseudoPort]:
    """A sketch that prints its milliseconds and two numbers, 250 times a second."""
    port, ending = PseudoPort(path), threading.Event()
    port.plug()

    def run() -> None:
        start_s, line = time.monotonic(), 0
        while not ending.wait(0.001):
            while line < (time.monotonic() - start_s) * RATE_HZ:
                port.write(b"%d,%d,7\n" % (line * 4, line))
                line += 1

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield port
    finally:
        ending.set()
        thread.join()
        port.unplug()


@pytest.fixture(scope="module", params=["one board", "three boards", "lines of numbers"])
def opener(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Opener]:
    """What opens it; the boards run on while sources come and go."""
    folder = tmp_path_factory.mktemp("ports")
    with contextlib.ExitStack() as stack:
        if request.param == "lines of numbers":
            port = stack.enter_context(printing(folder / "sketch"))
            url = f"serial://{port.path}?format=csv&time=ms&rate_hz={RATE_HZ}"
        else:
            boards = [
                stack.enter_context(
                    RunningBoard(EmulatedBoard(board=i, rate_hz=RATE_HZ), folder / f"board{i}")
                )
                for i in range(3 if request.param == "three boards" else 1)
            ]
            url = "serial://" + ",".join(str(board.port.path) for board in boards)
        yield lambda: open_source(url)


def collect(source: Source, seconds: float, timeout_s: float = 0.1) -> Samples:
    parts, end_s = [], time.monotonic() + seconds
    while time.monotonic() < end_s:
        parts.append(source.read(timeout_s))
    return Samples.join(parts)


def test_each_scan_comes_once_oldest_first_however_it_is_read(opener: Opener):
    with opener() as source:
        hasty, patient = collect(source, 0.2, 0.0), collect(source, 0.2, 0.1)
        time.sleep(0.3)
        late = source.read(0.1)
    rows = Samples.join([hasty, patient, late])
    assert len(rows) > 0.3 * RATE_HZ
    assert (np.diff(rows.counter) == 1).all()
    own = rows.counter[np.isfinite(rows.device_s)], rows.device_s[np.isfinite(rows.device_s)]
    np.testing.assert_allclose(np.diff(own[1]), np.diff(own[0]) / RATE_HZ, atol=1e-5)


def test_info_describes_what_is_read(opener: Opener):
    with opener() as source:
        info, rows = source.info, collect(source, 0.5)
        assert source.cameras == ()
        assert (source.frames(), source.marks()) == ([], [])
    assert rows.values.shape[1] == len(info.channels) == len(info.units)
    assert rows.values.dtype == np.float32
    known = rows[np.isfinite(rows.device_s)]
    rate_hz = np.diff(known.counter).sum() / (known.device_s[-1] - known.device_s[0])
    assert rate_hz == pytest.approx(info.rate_hz, rel=0.01)


def test_time_starts_at_opening_and_never_runs_backwards(opener: Opener):
    before_s = time.monotonic()
    with opener() as source:
        opened_s = time.monotonic()
        rows = collect(source, 0.4)
    assert before_s <= rows.fitted_s[0] <= opened_s + 0.1
    assert (np.diff(rows.fitted_s) >= 0).all()
    assert (np.diff(rows.arrival_s) >= 0).all()
    own_s = rows.device_s[np.isfinite(rows.device_s)]
    assert len(own_s) > 0.8 * len(rows)
    assert (np.diff(own_s) >= 0).all()


def test_a_scan_is_not_given_before_it_arrives(opener: Opener):
    clock = SystemClock()
    with opener() as source:
        for _ in range(40):
            rows = source.read(0.01)
            assert (rows.arrival_s <= clock.now_s()).all()
            assert (rows.fitted_s <= clock.now_s()).all()


def test_all_that_is_due_comes_at_once(opener: Opener):
    """In one of five tries at least: a busy machine may give the boards no turn meanwhile."""
    with opener() as source:
        for _ in range(5):
            collect(source, 0.1)
            left_s = time.monotonic()
            time.sleep(0.4)
            asked_s = time.monotonic()
            rows = source.read(0.1)
            took_s = time.monotonic() - asked_s
            due = (asked_s - left_s) * RATE_HZ
            if took_s < 0.09 and abs(len(rows) - due) < 0.1 * due and rows.usable.mean() > 0.9:
                return
    raise AssertionError(f"{len(rows)} rows of {due:.0f} in {took_s:.3f} s")


def test_the_timeout_is_kept(opener: Opener):
    with opener() as source:
        collect(source, 0.1)
        for timeout_s in (0.0, 0.002, 0.0, 0.002):
            asked_s = time.monotonic()
            source.read(timeout_s)
            assert time.monotonic() - asked_s < timeout_s + 0.3


def test_leaving_the_block_closes_it_and_nothing_comes_after(opener: Opener):
    with opener() as source:
        assert not source.ended
        collect(source, 0.1)
    asked_s = time.monotonic()
    assert source.ended
    assert (len(source.read(5.0)), source.marks()) == (0, [])
    assert time.monotonic() - asked_s < 0.1


def test_an_error_inside_the_block_comes_out(opener: Opener):
    with pytest.raises(RuntimeError, match="mine"), opener():
        raise RuntimeError("mine")
