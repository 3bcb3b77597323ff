"""A gate may leave a fold nothing to test: its trials are not scored, and the others are."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from taxel.errors import BadSplit
from taxel.evaluation.nested import check_choosing
from taxel.evaluation.splits import Split, TrialFold
from taxel.recordings.imports.importing import ImportRow, import_rows
from taxel.sim.teng.constants import SENSORS
from taxel.training.choose.base import Base, load_base
from taxel.training.choose.budget import Budget
from taxel.training.choose.preparations import Prepared, prepare_all
from taxel.training.choose.search import Effort

PRESSES = 16
WEAK = 4
"""The last presses, which stay below the upper gate."""


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> tuple[Base, Prepared]:
    """Return presses on a hand's twelve sensors, cut above 1.55 V."""
    folder = tmp_path_factory.mktemp("hand")
    rng = np.random.default_rng(5)
    rows = []
    for number in range(PRESSES):
        kind = number % 2
        values = rng.normal(0.0, 0.02, (90, len(SENSORS)))
        values[10:85, kind] += 1.0 if number >= PRESSES - WEAK else 2.0
        file = folder / f"p{number:02d}.csv"
        lines = [",".join(f"{value:.4f}" for value in row) for row in values]
        file.write_text("\n".join([",".join(SENSORS), *lines]) + "\n")
        rows.append(
            ImportRow(file=file, labels={"kind": ("round", "flat")[kind]}, time="rate:100Hz",
                      sensor="teng", channels=" ".join(f"{name}[V]" for name in SENSORS))
        )  # fmt: skip
    import_rows(rows, folder / "recordings")
    base = load_base(folder / "recordings", "kind")
    return base, next(own for own in prepare_all(base) if own.config.gate == 1.55)


def effort() -> Effort:
    """Return one without time for more than the tries that it must make."""
    ticks = count()
    return Effort(budget=Budget(0.0, shares=2, clock=lambda: float(next(ticks)), at_once=1))


def fold(name: str, first: int, last: int) -> TrialFold:
    tested = frozenset(range(first, last))
    return TrialFold(name, frozenset(range(PRESSES)) - tested, tested)


def test_a_fold_without_test_windows_is_not_scored(hand: tuple[Base, Prepared]):
    base, prepared = hand
    split = Split("by turns", (fold("a", 0, 4), fold("weak", PRESSES - WEAK, PRESSES)), None)

    found = check_choosing(base, [prepared], split, effort(), ("channel means",))

    assert found.by_trial.trials == 4
    assert set(found.predictions.fold.tolist()) == {0}
    assert found.bars["channel means"][1].trials == 4
    assert set(found.trivial) >= {"majority", "channel means"}


def test_windows_at_the_limit_are_known_of_what_was_tested(hand: tuple[Base, Prepared]):
    """Live answers UNKNOWN to them, which train must say beside an accuracy that counts them."""
    base, prepared = hand
    windows = replace(prepared.dataset.windows, saturated=np.ones(len(prepared.trial)))
    full = replace(prepared, dataset=replace(prepared.dataset, windows=windows))
    split = Split("by turns", (fold("a", 0, 4),), None)

    found = check_choosing(base, [full], split, effort()).predictions

    assert found.at_limit is not None
    assert found.at_limit.all()


def test_a_split_without_test_windows_is_refused(hand: tuple[Base, Prepared]):
    base, prepared = hand
    split = Split("weak ones", (fold("weak", PRESSES - WEAK, PRESSES),), None)

    with pytest.raises(BadSplit, match=r"none in the test trials \(weak ones\)"):
        check_choosing(base, [prepared], split, effort())
