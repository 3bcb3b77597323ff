"""The way to cut that is chosen: what it leaves without a window counts against it."""

from pathlib import Path

import numpy as np

from taxel.recordings.importing import ImportRow, import_rows
from taxel.sim.teng_constants import SENSORS
from taxel.training.choose.budget import Budget
from taxel.training.choose.inner_folds import Held
from taxel.training.choose.preparations import Base, load_base, prepare_all
from taxel.training.choose.search import Effort, choose

RATE = 100.0
PRESSES = 24


def hand(folder: Path) -> Base:
    """Return presses on a hand's twelve sensors: every third crosses 1.55 V, and is plain there.

    The others reach 1 V, where the two classes are told apart four times in five.
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


def test_a_gate_that_leaves_most_touches_undecided_is_not_chosen_for_being_right_on_the_rest(
    tmp_path: Path,
):
    base = hand(tmp_path)
    prepared = prepare_all(base)
    decided = {own.config.gate: len(set(own.trial)) for own in prepared}
    assert decided == {0.6: PRESSES, 1.55: PRESSES // 3}

    found = choose(
        base, prepared, range(PRESSES), Held("session"), Effort(budget=Budget(0.0, at_once=1))
    )

    quick = {cut: tried.loss for cut, _, tried in found.board if "trees" in tried.candidate.name}
    assert quick["12 rows above 1.55"] < quick["60 rows above 0.6"]
    assert found.part.prepared.config.gate == 0.6
