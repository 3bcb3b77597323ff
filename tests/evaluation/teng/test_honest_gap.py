"""The ladder from a leaking split to held-out sessions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from taxel.evaluation.teng.honest_gap import RUNGS, Rung, Step, closed, honest_gap
from taxel.sources.simulated.data_sets import write_sessions
from taxel.sources.simulated.teng_options import checked_config
from taxel.training.loop import TrainConfig


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gap") / "honest"
    config = checked_config(seed=3, sessions=4, scans_per_class=25_000, rate_hz=100.0)
    write_sessions(folder, config, lambda _: None)
    return folder


@pytest.mark.slow
def test_three_known_touches_bring_an_unseen_session_nearer_to_random_windows(sessions: Path):
    wanted = {("as measured", "random"), ("as measured", "session"),
              ("3 reference touches", "session")}  # fmt: skip
    rungs = [rung for rung in RUNGS if (rung.name, rung.split) in wanted]
    steps = honest_gap(
        [sessions], rungs=rungs, targets=("shape",), train=TrainConfig(epochs=40), workers=1
    )
    by_name = {(step.rung.name, step.rung.split): step.accuracy for step in steps}
    assert by_name["as measured", "random"] > by_name["as measured", "session"] + 0.05
    assert closed(steps, "shape", "3 reference touches") > 0.5


def test_a_window_by_its_own_level_knows_nothing_of_its_strength(sessions: Path):
    rung = next(step for step in RUNGS if step.own_level)
    (own,) = honest_gap(
        [sessions], rungs=[rung], targets=("material",), train=TrainConfig(epochs=1), workers=1
    )
    assert 0.2 < own.accuracy < 0.6, "material is told by strength, which is gone"


def test_the_share_closed_is_0_for_nothing_and_1_for_random_windows():
    def step(name: str, split: str, value: float) -> Step:
        rung = replace(RUNGS[0], name=name, split=split)  # type: ignore[arg-type]
        return Step(rung, "shape", (value,), (value,))

    ends = [step("as measured", "random", 0.9), step("as measured", "session", 0.5)]
    assert closed([*ends, step("x", "session", 0.5)], "shape", "x") == pytest.approx(0.0)
    assert closed([*ends, step("x", "session", 0.9)], "shape", "x") == pytest.approx(1.0)
    assert closed([*ends, step("x", "session", 0.7)], "shape", "x") == pytest.approx(0.5)


def test_every_rung_has_a_name_of_its_own_under_its_split():
    names = [(rung.name, rung.split) for rung in RUNGS]
    assert len(set(names)) == len(names)
    assert all(isinstance(rung, Rung) for rung in RUNGS)
