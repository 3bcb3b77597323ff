"""What is given up for time is what costs least, by the times of the engine that runs it."""

from collections.abc import Collection, Sequence
from itertools import chain, repeat
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from taxel.models.heads import TreesHead
from taxel.models.onnx_session import WindowModel
from taxel.models.touch_features import TouchFeatures
from taxel.training.choose.base import load_base
from taxel.training.choose.budget import Budget
from taxel.training.choose.candidates import Candidate, discriminant, first_round
from taxel.training.choose.choice import Choice, Member
from taxel.training.choose.costs import ROUNDS, RUNS, Cost
from taxel.training.choose.fitting import fit_head
from taxel.training.choose.inner_folds import Held
from taxel.training.choose.limits import Limits, _quick_enough, _Saving, _units, fit_within
from taxel.training.choose.pieces import Pieces, engine_us
from taxel.training.choose.preparations import prepare_all
from taxel.training.choose.search import Effort, SearchResult, choose

TRAIN = list(range(16))
NETWORK = Member(candidate=Candidate("network", "touchnet", ""), blocks=(), weight=0.5,
                 sharpness=1.0)  # fmt: skip
FOREST = Member(candidate=Candidate("trees", "extra-trees", "statistics", 2),
                blocks=("statistics",), weight=0.25, sharpness=1.0)  # fmt: skip
SUM = Member(candidate=Candidate("linear", "logistic", "means", 1.0), blocks=("mean",),
             weight=0.25, sharpness=1.0)  # fmt: skip


@pytest.fixture(scope="module")
def found(recordings: Path) -> SearchResult:
    base = load_base(recordings, "kind")
    effort = Effort(budget=Budget(1e6))  # all candidates, however quick the machine
    return choose(base, prepare_all(base), TRAIN, Held("session"), effort)


def slow_quantiles(models: Sequence[nn.Module], *_: object) -> list[float]:
    """Each block takes 100 µs, quantiles 3,000."""
    return [
        sum(3000.0 if block == "quantiles" else 100.0 for block in cast(Any, model).blocks)
        for model in models
    ]


def test_features_that_alone_take_too_long_are_not_tried(
    recordings: Path, monkeypatch: pytest.MonkeyPatch
):
    """With 486 taxels all sets but channel means took 2 ms or more: every try was in vain."""
    monkeypatch.setattr("taxel.training.choose.pieces.LARGE", 100)
    base = load_base(recordings, "kind")
    prepared = prepare_all(base)
    whole = choose(base, prepared, TRAIN, Held("session"), Effort(budget=Budget(1e6)))
    effort = Effort(budget=Budget(1e6), pieces=Pieces(slow_quantiles), most_us=1700.0)
    found = choose(base, prepared, TRAIN, Held("session"), effort)

    assert whole.choice().slow == ()
    assert found.choice().slow == ("quantiles",)
    assert not any("quantiles" in blocks for blocks in found.sets.values())
    assert found.sets["all"] == tuple(b for b in whole.sets["all"] if b != "quantiles")
    # 100 µs allow for no more than a block: sets are told apart no longer, and none is lost.
    few, _ = Pieces(slow_quantiles).quick_sets(whole.sets, whole.part.prepared, 270.0)
    assert {len(blocks) for blocks in few.values()} == {1}
    assert next(iter(few)) != "means"


def test_channel_means_come_first_where_only_kernels_are_quick_beside_them(
    found: SearchResult, monkeypatch: pytest.MonkeyPatch
):
    """Quick models, by which ways to cut are compared, see the first set."""
    monkeypatch.setattr("taxel.training.choose.pieces.LARGE", 100)

    def measure(models: Sequence[nn.Module], *_: object) -> list[float]:
        quick = {"mean", "kernels"}
        return [sum(100.0 if block in quick else 3000.0 for block in cast(Any, model).blocks)
                for model in models]  # fmt: skip

    quick, _ = Pieces(measure).quick_sets(found.sets, found.part.prepared, 1000.0)
    assert list(quick) == ["means", "kernels"]
    assert first_round(quick, 30)[0].features == "means"


def test_features_of_small_windows_are_not_timed(found: SearchResult):
    def never(*_: object) -> list[float]:
        raise AssertionError

    sets, slow = Pieces(never).quick_sets(found.sets, found.part.prepared, 1.0)
    assert (sets, slow) == (found.sets, ())


class Timed(Pieces):
    """Pieces that take what a function of the choice says."""

    def __init__(self, us: Any) -> None:
        super().__init__()
        self._of = us

    def us(self, choice: Choice, *_: object) -> float:
        return float(self._of(choice))


def sets_of(choice: Choice) -> set[tuple[str, ...]]:
    return {member.blocks for member in choice.members if member.blocks}


def within(found: SearchResult, us: Any, most_us: float) -> Any:
    """Return what is left where a choice takes `us` microseconds, foretold; measured, the whole
    takes as many, and what is left is quick.
    """
    costs = chain([us(found.choice())], repeat(0.0))
    return fit_within(
        found, TRAIN, Limits(most_us=most_us), cost=lambda *_: Cost(1.0, next(costs)),
        pieces=Timed(us),
    )  # fmt: skip


@pytest.mark.slow
def test_of_what_would_do_at_once_the_least_loss_goes(found: SearchResult):
    whole = found.choice()

    def us(choice: Choice) -> float:
        return 3000.0 if choice.members == whole.members else 1000.0

    fitted = within(found, us, 2000.0)

    ways = [found.choice(unit).loss for unit in _units(found, whole, set()).values()]
    assert len(ways) > 2
    assert fitted.choice.loss == min(ways)
    assert len(fitted.given_up) == 1
    assert "3000 µs with it; inner accuracy" in fitted.given_up[0]
    assert "--max-us" not in fitted.given_up[0]  # all are right without it
    assert fitted.choice.why.startswith("of what keeps to the limits, ")
    assert not whole.why.startswith("of what")


@pytest.mark.slow
def test_a_limit_that_costs_much_is_named(found: SearchResult, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("taxel.training.choose.limits.WORTH_SAYING", -1.0)
    whole = found.choice()

    fitted = within(found, lambda c: 3000.0 if c.members == whole.members else 1000.0, 2000.0)

    assert fitted.given_up[0].endswith("; a larger --max-us keeps it")


def test_of_what_is_not_enough_the_cheapest_for_its_time_goes_and_what_saves_nothing_last():
    """Though the loss falls without it: a small gain on inner folds is no reason to drop a kind."""

    def rank(us: float, loss: float, gone: int = 1) -> tuple[int, float, str]:
        choice = cast(Choice, SimpleNamespace(loss=loss))
        return _Saving("it", choice, us, gone).rank(0.5, 2000.0, 1000.0)

    much, little, nothing = rank(1200.0, 0.505), rank(1900.0, 0.49), rank(2000.0, 0.4)
    assert rank(1000.0, 0.9) < much < little < nothing
    assert rank(1500.0, 0.49) < rank(1600.0, 0.45)  # a loss that falls pays for nothing
    assert rank(2000.0, 0.9, gone=3) < nothing


@pytest.mark.slow
def test_what_saves_nothing_is_kept_and_several_things_go_where_one_is_not_enough(
    found: SearchResult,
):
    whole = found.choice()
    assert len(sets_of(whole)) > 1

    fitted = within(found, lambda choice: 1000.0 * len(sets_of(choice)), 1500.0)

    assert len(sets_of(fitted.choice)) == 1
    assert any(not member.blocks for member in whole.members)
    (line,) = fitted.given_up
    assert "TouchNet" not in line


def test_each_piece_is_timed_once_without_what_any_call_takes():
    values = np.zeros((3, 24, 2), np.float32)
    prepared = SimpleNamespace(
        dataset=SimpleNamespace(windows=SimpleNamespace(values=values, mask=values[:, :, 0] == 0)),
        pads=(0, 0),
        grids=(),
        config=SimpleNamespace(pad=False),
    )
    rng = np.random.default_rng(0)
    y = np.arange(40) % 2
    forest = fit_head(FOREST.candidate, rng.normal(size=(40, 6)).astype(np.float32), y, 2, 0)
    assert isinstance(forest, TreesHead)
    measured: list[str] = []

    def measure(models: Sequence[nn.Module], values: Tensor, mask: Tensor) -> list[float]:
        for model in models:
            model(values, mask)
            blocks = getattr(model, "blocks", ())
            measured.append("+".join(blocks) or type(model).__name__)
        known = {"_Nothing": 10.0, "mean": 60.0, "mean+statistics": 110.0, "_OnFeatures": 210.0}
        return [known.get(name, 40.0) for name in measured[-len(models) :]]

    class Net(nn.Module):
        def forward(self, values: Tensor, mask: Tensor) -> Tensor:
            return values[:, 0] * mask[:, :1]

    heads: dict[Any, nn.Module] = {(FOREST.candidate, 0): forest}
    heads |= {(NETWORK.candidate, copy): Net() for copy in range(2)}
    pieces = Pieces(measure)

    def us(*members: Member) -> float:
        choice = cast(Choice, SimpleNamespace(members=members))
        return pieces.us(choice, cast(Any, prepared), heads)

    assert us(NETWORK, FOREST, SUM) == 30.0 + 60.0 + 50.0 + 200.0
    assert us(NETWORK, SUM) == 30.0 + 60.0
    assert us(NETWORK) == 30.0
    assert sorted(measured) == ["_Beside", "_Nothing", "_OnFeatures", "mean", "mean+statistics"]


def test_rows_standardised_across_a_pad_are_counted_once_for_all_blocks_of_them(
    found: SearchResult, monkeypatch: pytest.MonkeyPatch
):
    """Counted in each of three blocks, they left the pad's own patterns no time on 486 taxels."""
    monkeypatch.setattr("taxel.training.choose.pieces.LARGE", 100)

    def measure(models: Sequence[nn.Module], *_: object) -> list[float]:
        blocks = [cast(Any, model).blocks for model in models]
        return [100.0 * len(own) + 500.0 * any(b.startswith("unit/") for b in own)
                for own in blocks]  # fmt: skip

    sets = {"means": ("mean",), "across the pad": ("unit/level", "unit/course", "unit/parts")}
    kept, slow = Pieces(measure).quick_sets(sets, found.part.prepared, 1400.0)
    assert (kept["across the pad"], slow) == (sets["across the pad"], ())
    kept, slow = Pieces(measure).quick_sets(sets, found.part.prepared, 1300.0)
    assert (len(kept["across the pad"]), len(slow)) == (2, 1)


def test_what_is_timed_gives_in_the_engine_what_the_piece_gives(monkeypatch: pytest.MonkeyPatch):
    window = torch.randn(1, 24, 2), torch.ones(1, 24, dtype=torch.bool)
    features = TouchFeatures(("mean", "statistics"), (0, 0))
    ran: list[Any] = []

    def opened(model: bytes) -> Any:
        ready = WindowModel(model)
        return lambda *given: ran.append(ready(*given))

    monkeypatch.setattr("taxel.training.choose.pieces.WindowModel", opened)

    assert min(engine_us([features, features], *window)) > 0.0
    assert len(ran) == 2 * ROUNDS * RUNS
    assert ran[-1] == pytest.approx(features(*window).numpy(), abs=1e-5)


class Drawn:
    """A search of a good set of features that takes most of the time, and of four poor ones."""

    def __init__(self, values: int) -> None:
        self.part = SimpleNamespace(values=values)
        self.own = [discriminant(name, 0.3) for name in ("imprints", "all", "rows", "tared")]
        self.board = [("", self.part, SimpleNamespace(candidate=own)) for own in self.own]
        self.sets = {own.features: (own.features,) for own in self.own}

    def choice(self, without: Collection[Candidate] = ()) -> Any:
        left = [own for own in self.own if own not in without]
        members = tuple(Member(candidate=own, blocks=(own.features,), weight=1.0, sharpness=1.0)
                        for own in left)  # fmt: skip
        good = any(own.features == "imprints" for own in left)
        return SimpleNamespace(members=members, loss=0.5 if good else 0.8)


def us_of(choice: Any) -> float:
    return sum(1000.0 if own.candidate.features == "imprints" else 100.0 for own in choice.members)


@pytest.mark.parametrize(
    ("values", "left"), [(6000, {"imprints"}), (4000, {"all", "rows", "tared"})]
)
def test_one_good_set_of_large_windows_is_kept_where_it_fits_alone(values: int, left: set[str]):
    """A skin's imprints went, because nothing else was enough at once, and a poor rest stayed."""
    drawn: Any = Drawn(values)

    gone, choice, names = _quick_enough(drawn, drawn.choice(), set(), us_of, 1050.0 / 1300.0)

    assert {own.candidate.features for own in choice.members} == left
    assert {own.features for own in drawn.own} - {own.features for own in gone} == left
    assert names == (["all but imprints"] if left == {"imprints"} else ["every model on imprints"])
