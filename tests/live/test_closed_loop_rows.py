"""Claims about the rows of `taxel bench closed-loop`, over made-up pours."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.bench.closed_loop import steps
from taxel.bench.closed_loop.pours import HARD, UNSEEN
from taxel.bench.closed_loop.scores import LoopCase
from taxel.bench.closed_loop.steps import JudgedPour, data_digest, loop_rows
from taxel.bench.closed_loop.training import PIXEL_CUPS, raisable
from taxel.live.closed_loop import GripCommand, LoopTrack
from taxel.sim.pour.cup_pour import list_runs
from taxel.sim.pour.cups import PourRun
from taxel.training.slip.cups import TRAINING_CUPS

RUN = next(run for run in list_runs(UNSEEN) if run.kind == "pour")
PUSH = replace(RUN, kind="bump")


def track(run: PourRun, *, dropped: bool = False, raised: bool = False) -> LoopTrack:
    truth = np.zeros((4, 8))
    truth[:, 0] = [0.0, 50.0, 200.0, 9000.0 if dropped else 250.0]
    truth[-1, 7] = dropped
    return LoopTrack(
        run=run,
        time_s=np.arange(4) / 10,
        truth=truth,
        force_n=np.full(4, 30.0 if raised else 15.0),
        commands=(GripCommand(time_s=0.25, force_n=50.0),) if raised else (),
    )


def judged(run: PourRun, *, drops: bool, taxel_raises: bool) -> JudgedPour:
    bare = track(run, dropped=drops)
    full = replace(track(run), force_n=np.full(4, 50.0))
    held = track(run, raised=True) if taxel_raises else bare
    return JudgedPour(
        run=run,
        taxel=LoopCase(bare=bare, full=full, held=held),
        pixels=LoopCase(bare=bare, full=full, held=track(run, raised=True)),
        always=LoopCase(bare=bare, full=full, held=full),
        person=LoopCase(bare=bare, full=full, held=bare),
        latencies_s=(0.001, 0.012),
    )


def test_the_rows_report_what_was_prevented_and_what_was_needless() -> None:
    pours = [
        judged(RUN, drops=True, taxel_raises=True),
        judged(RUN, drops=True, taxel_raises=False),
        judged(RUN, drops=False, taxel_raises=False),
        judged(RUN, drops=False, taxel_raises=True),
        judged(PUSH, drops=True, taxel_raises=False),
    ]
    rows = {row.name: row for row in loop_rows(pours)}
    prevented = rows["taxel: preventable drops prevented, unseen cups"]
    assert (prevented.value, prevented.ok) == (0.5, False)
    assert "1 of 2 preventable of 2 drops in 4 pours" in prevented.note
    needless = rows["taxel: raised needlessly in pours that hold"]
    assert (needless.value, needless.ok) == (0.5, False)
    assert rows["always maximum: raised needlessly in pours that hold"].value == 1.0
    assert rows["pixel difference: raised needlessly in pours that hold"].value == 1.0
    force = rows["taxel: mean grip force"]
    assert force.value == pytest.approx((30 + 15 + 15 + 30) / 4)
    hard = next(row for name, row in rows.items() if "pushes" in name and "prevented" in name)
    assert hard.value == 0.0
    assert hard.ok is None


def test_without_any_drop_a_row_says_so_and_is_not_met() -> None:
    rows = loop_rows([judged(RUN, drops=False, taxel_raises=False)])
    assert not rows[0].ok
    empty = next(row for row in rows if row.name.startswith("pixel difference: preventable"))
    assert empty.value is None
    assert "none to measure it on" in empty.note


def test_no_cup_is_both_learned_from_and_judged() -> None:
    learned = {run.cup.index for run in list_runs(PIXEL_CUPS)} | set(TRAINING_CUPS)
    judged = {run.cup.index for run in list_runs(UNSEEN) + list_runs(HARD)}
    assert not learned & judged
    assert sum(map(raisable, list_runs(UNSEEN))) >= 200


@pytest.mark.parametrize("judged", ["UNSEEN", "HARD"])
def test_the_digest_is_that_of_the_judged_runs(
    judged: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = data_digest(None)
    assert len(before) == 64

    monkeypatch.setattr(steps, judged, replace(getattr(steps, judged), cups=41))
    assert data_digest(None) != before
