"""Signs of life are read whole, whenever the reader looks."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from taxel.live.station import beats
from taxel.live.station.beats import Beat, Beats, BeatsView, Work


class WatchedCells:
    """A board's cells; looks at the board after each store, as a reader at a bad moment does."""

    def __init__(self, cells: memoryview, look: Callable[[], None]) -> None:
        self._cells, self._look = cells, look

    def __getitem__(self, at: int) -> int:
        return self._cells[at]

    def __setitem__(self, at: int, value: int) -> None:
        self._cells[at] = value
        self._look()

    def release(self) -> None:
        self._cells.release()


@pytest.fixture
def at_each_store(monkeypatch: pytest.MonkeyPatch):
    """Return a function: writes first one and then another beat; gives all that could be read."""

    def write(first: dict[str, object], then: dict[str, object]) -> list[Beat]:
        now_ns = [5_000_000_000]
        monkeypatch.setattr(beats.time, "monotonic_ns", lambda: now_ns[0])
        seen: list[Beat] = []
        with Beats() as board:
            view = BeatsView(board.name)
            view.write(3, **first)  # type: ignore[arg-type]
            view._cells = WatchedCells(view._cells, lambda: seen.append(board.read(3)))  # type: ignore[assignment]
            now_ns[0] += 200_000_000
            view.write(3, **then)  # type: ignore[arg-type]
            view.close()
        return seen

    return write


@pytest.mark.parametrize(("before_s", "after_s"), [(1.0, 0.0), (0.0, 1.0), (1.0, 0.5)])
def test_a_moment_is_never_read_with_another_steps_patience(at_each_store, before_s, after_s):
    """A long step of 0.2 s ends: its time without its patience was a STOP without a cause."""
    seen = at_each_store({"patience_s": before_s}, {"patience_s": after_s})

    assert {(beat.beat_s, beat.patience_s) for beat in seen} == {(5.0, before_s), (5.2, after_s)}


def test_who_begins_to_run_is_not_read_with_a_sign_from_before(at_each_store):
    seen = at_each_store({"work": Work.STARTING}, {"work": Work.RUNNING, "produced": 7})

    assert all(beat.beat_s == 5.2 for beat in seen if beat.work is Work.RUNNING)
    assert seen[-1] == Beat(5.2, Work.RUNNING, 7, 0, 0, 0.0)


def test_the_last_counts_stand_when_the_end_is_read(at_each_store):
    seen = at_each_store({"produced": 7}, {"work": Work.ENDED, "produced": 8, "consumed": 9})

    assert all((beat.produced, beat.consumed) == (8, 9) for beat in seen if beat.work is Work.ENDED)


def test_more_patience_than_a_board_can_hold_is_cut():
    with Beats() as board:
        view = BeatsView(board.name)
        view.write(0, patience_s=1e6)
        assert board.read(0).patience_s == pytest.approx(65.535)
        view.close()
