"""The way to cut that is chosen: what it leaves without a window counts against it."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from taxel.errors import BadSplit
from taxel.recordings.imports.importing import ImportRow, import_rows
from taxel.sim.teng.constants import SENSORS
from taxel.training.choose.base import Base, load_base
from taxel.training.choose.budget import Budget
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.cuts import best_cut
from taxel.training.choose.inner_folds import Held
from taxel.training.choose.part import Part, Tried
from taxel.training.choose.preparations import Prepared, prepare_all
from taxel.training.choose.search import Effort, SearchResult, choose, out_of_fold

RATE = 100.0
PRESSES = 24


def hand(folder: Path) -> Base:
    """Return presses on a hand's twelve sensors: every third crosses 1.55 V, and is plain there.

    The others reach 1 V, where the two classes are distinguished four times in five.
    """
    rng = np.random.default_rng(3)
    rows = []
    for number in range(PRESSES):
        kind = number % 2
        strong = number // 2 % 3 == 0
        level = 2.0 if strong else 1.0
        shown = kind if strong or rng.random() < 0.8 else 1 - kind
        values = rng.normal(0.0, 0.02, (90, len(SENSORS)))
        values[10:85, :] += 0.3 * level
        values[10:85, shown] += 0.7 * level
        file = folder / f"p{number}.csv"
        lines = [",".join(f"{value:.4f}" for value in row) for row in values]
        file.write_text("\n".join([",".join(SENSORS), *lines]) + "\n")
        rows.append(
            ImportRow(file=file, labels={"kind": ("round", "flat")[kind]},
                      groups={"session": f"s{number // 6}"}, time=f"rate:{RATE:g}Hz", sensor="teng",
                      channels=" ".join(f"{name}[V]" for name in SENSORS))
        )  # fmt: skip
    import_rows(rows, folder / "recordings")
    return load_base(folder / "recordings", "kind")


def until(tries: int) -> Effort:
    """Return an effort whose time is up after so many tries began."""
    begun: list[str] = []
    clock = lambda: 0.0 if len(begun) <= tries else 1e9  # noqa: E731
    return Effort(budget=Budget(60.0, clock=clock, at_once=1), on_step=begun.append)


@pytest.mark.slow
def test_a_gate_that_leaves_most_touches_undecided_is_not_chosen_for_being_right_on_the_rest(
    tmp_path: Path,
):
    base = hand(tmp_path)
    prepared = prepare_all(base)
    decided = {own.config.gate: len(set(own.trial)) for own in prepared}
    assert decided == {0.6: PRESSES, 1.55: PRESSES // 3}

    found = choose(base, prepared, range(PRESSES), Held("session"), until(2 + 2 + 2))
    gated = choose(base, prepared[1:], range(PRESSES), Held("session"), until(2))

    assert tree_loss(gated) < tree_loss(found)
    assert found.part.prepared.config.gate == 0.6


def tree_loss(found: SearchResult) -> float:
    return next(tried.loss for _, _, tried in found.board if tried.candidate.family == "trees")


def weak(base: Base, strong: set[int], kind: str) -> list[int]:
    """Return all trials but the strong ones of a kind, of both unless one is named."""
    return [i for i, trial in enumerate(base.trials)
            if i not in strong or kind not in ("", trial.labels["kind"])]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["flat", ""])
def test_a_gate_that_leaves_fewer_than_two_classes_to_learn_from_is_not_tried(
    tmp_path: Path, kind: str
):
    base = hand(tmp_path)
    prepared = prepare_all(base)
    train = weak(base, set(prepared[1].trial.tolist()), kind)

    found = choose(base, prepared, train, Held("session"), until(6))

    assert {cut for cut, _, _ in found.board} == {"60 rows above 0.6"}
    with pytest.raises(BadSplit, match="windows in two training trials of two classes"):
        choose(base, prepared[1:], train, Held("session"), until(6))


def slides(folder: Path, *, differ_in: str) -> Base:
    """Return long slides of two kinds that differ in a bump's place or in each row's level.

    Short windows do not see the place.
    """
    rng = np.random.default_rng(4)
    rows = []
    for number in range(24):
        kind = number % 2
        values = rng.normal(0.0, 0.05, (900, 2))
        if differ_in == "place":
            start = 40 + 600 * kind + int(rng.integers(0, 40))
            values[start : start + 30] += 1.0
        else:
            values += 0.5 * kind
        file = folder / f"s{number}.csv"
        lines = [",".join(f"{value:.4f}" for value in row) for row in values]
        file.write_text("\n".join(["a,b", *lines]) + "\n")
        rows.append(
            ImportRow(file=file, labels={"kind": ("early", "late")[kind]},
                      groups={"session": f"s{number // 6}"}, time="rate:100Hz", sensor="pad",
                      channels="a[V] b[V]")
        )  # fmt: skip
    import_rows(rows, folder / "recordings")
    return load_base(folder / "recordings", "kind")


def board_cuts(found: SearchResult) -> list[str]:
    """Return the ways to cut on the leaderboard, each once."""
    return list(dict.fromkeys(cut for cut, _, _ in found.board))


@pytest.mark.slow
def test_a_way_to_cut_that_is_far_behind_on_one_inner_fold_is_not_compared_on_all(tmp_path: Path):
    base = slides(tmp_path, differ_in="place")
    prepared = prepare_all(base)
    assert [own.config.steps for own in prepared] == [900, 400, 100, 25]

    found = choose(base, prepared, range(24), Held("session"), until(2 + 2 + 2 + 2 + 2))

    assert found.behind == ("100 rows", "25 rows")
    assert board_cuts(found) == ["900 rows", "400 rows"]
    assert found.choice().behind == found.behind


@pytest.mark.slow
def test_what_a_first_look_found_is_used_again_and_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    fits: list[int] = []

    def counted(part: Part, *rest: Any) -> Any:
        fits.append(part.steps)
        return out_of_fold(part, *rest)

    monkeypatch.setattr("taxel.training.choose.search.out_of_fold", counted)
    base = slides(tmp_path, differ_in="level")
    prepared = [own for own in prepare_all(base) if own.config.steps in (400, 900)]

    found = choose(base, prepared, range(24), Held("session"), until(2 + 2 + 2))
    # Two models on three folds each, and of the way that is taken a third.
    assert (fits.count(900), fits.count(400)) == (3 * 3, 2 * 3)

    alone = choose(base, prepared[1:], range(24), Held("session"), until(2 + 2))

    assert board_cuts(found) == ["900 rows", "400 rows"]
    for model in ("logistic", "extra-trees"):
        looked, plain = (
            next(tried for cut, _, tried in own.board
                 if cut == "400 rows" and tried.candidate.model == model
                 and tried.candidate.features == "all")
            for own in (found, alone)
        )  # fmt: skip
        assert np.array_equal(looked.probabilities, plain.probabilities)


class Seen:
    """Tries that note the parts they are asked about, and know nothing of them."""

    def __init__(self) -> None:
        self.parts: list[Part] = []

    def spent(self) -> float:
        return 0.0

    def look(self, *_: Any) -> list[Tried]:
        raise AssertionError("one way to cut is not looked at before it is compared")

    def try_all(self, part: Part, *_: Any, must: bool) -> None:
        self.parts.append(part)

    def of(self, part: Part) -> list[Tried]:
        even = np.full((int(part.scored.sum()), part.classes), 1 / part.classes)
        candidate = Candidate("linear", "logistic", "all", 0.03)
        return [Tried(candidate, even, 1.0, 1.0, 0.5, 0.0)]


@pytest.mark.parametrize("classes", [2, 3, 4])
def test_of_many_windows_those_compared_are_of_all_classes_though_recorded_in_turn(classes: int):
    """480 trials of ten windows, of one class after another: a third of them would do."""
    trial = np.repeat(np.arange(480), 10)
    prepared = SimpleNamespace(
        grids=(),
        starts=False,
        name="25 rows", trial=trial, kept=np.arange(len(trial)), stretch=trial,
        dataset=SimpleNamespace(
            windows=SimpleNamespace(values=np.zeros((len(trial), 25, 2)), padded=0)
        ),
    )  # fmt: skip
    part = Part(cast(Prepared, prepared), np.arange(len(trial)), trial // classes % 3,
                trial % classes, np.ones(len(trial), bool), classes)  # fmt: skip
    tries = Seen()

    assert best_cut([part], tries).best is part

    (thin,) = tries.parts
    cells = np.bincount(thin.fold * classes + thin.y, minlength=3 * classes)
    assert len(thin.rows) < len(trial) / 3
    assert (cells > 0.9 * cells.max()).all()
    assert set(np.bincount(thin.prepared.trial[thin.windows]).tolist()) == {0, 10}
    assert (part.name, thin.name) == ("25 rows", "25 rows, 1 of 4")


class Answers(Seen):
    """Tries whose answers are the same in all windows of a trial: 0.9 for its class, or 0.1."""

    def __init__(self, wrong: dict[int, int]) -> None:
        super().__init__()
        self.wrong = wrong
        """How many of the first trials are answered wrongly, by a window's rows."""

    def look(self, part: Part, candidates: Any, sets: Any, fold: int) -> list[Tried]:
        return self._answers(part, part.fold == fold)

    def of(self, part: Part) -> list[Tried]:
        return self._answers(part, part.scored)

    def _answers(self, part: Part, own: Any) -> list[Tried]:
        missed = part.prepared.trial[part.windows[own]] < self.wrong[part.steps]
        y = part.y[own]
        found = np.full((len(y), 2), 0.1)
        found[np.arange(len(y)), np.where(missed, 1 - y, y)] = 0.9
        return 2 * [Tried(Candidate("linear", "logistic", "all", 0.03), found, 1.0, 1.0, 0.5, 0.0)]


@pytest.mark.parametrize(("missed", "taken"), [(1, 900), (8, 100)])
def test_shorter_windows_must_be_better_by_more_than_chance_over_trials(missed: int, taken: int):
    """One of 40 trials that a whole misses makes short windows far better in the mean."""

    def part_of(steps: int, windows: int) -> Part:
        trial = np.repeat(np.arange(40), windows)
        prepared = SimpleNamespace(
            grids=(),
            starts=False,
            name=f"{steps} rows", trial=trial, kept=np.arange(len(trial)), stretch=trial,
            dataset=SimpleNamespace(
                windows=SimpleNamespace(values=np.zeros((len(trial), steps, 2)), padded=0)
            ),
        )  # fmt: skip
        return Part(cast(Prepared, prepared), np.arange(len(trial)), trial // 2 % 3, trial % 2,
                    np.ones(len(trial), bool), 2)  # fmt: skip

    found = best_cut([part_of(900, 1), part_of(100, 9)], Answers({900: missed, 100: 0}))

    assert found.best.steps == taken


def test_without_time_the_most_natural_way_is_taken_and_the_others_are_said(tmp_path: Path):
    base = slides(tmp_path, differ_in="level")

    found = choose(
        base, prepare_all(base), range(24), Held("session"), Effort(budget=Budget(0.0, at_once=1))
    )

    assert board_cuts(found) == ["900 rows"]
    assert any(name.endswith("· 100 rows") for name in found.left_out)
