"""Two small clean sets without files: pulses of an array, and frames of two cameras."""

from collections.abc import Callable

import numpy as np
import pytest

from taxel.evaluation.audit import evidence
from taxel.evaluation.audit.touch_set import TouchSet
from taxel.labels.trials import Trial

ROWS = 40


@pytest.fixture(autouse=True)
def _few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plants are told by four trees as well as by fifty."""
    monkeypatch.setattr(evidence, "TREES", 4)
    monkeypatch.setattr(evidence, "DRAWS", 2999)


def make_array(seed: int = 0, trials: int = 60, classes: int = 3) -> TouchSet:
    """Return pulses on six channels; which channel answers first says a little of the class."""
    rng = np.random.default_rng(seed)
    rows, found = [], []
    for index in range(trials):
        session, c = index % 5, (index // 5) % classes
        shape = np.exp(-np.clip(np.arange(ROWS) - rng.integers(8, 14), 0, None) / 8.0)
        shape[: rng.integers(6, 8)] = 0.0
        gains = rng.uniform(0.3, 1.0, 6)
        gains[c] += 0.2
        own = rng.normal(0.0, 0.3, 6)  # a rest level by which a trial is known again
        values = own + shape[:, None] * gains + rng.normal(0.0, 0.05, (ROWS, 6))
        rows.append(values.astype(np.float32))
        found.append((c, {"session": f"s{session}", "object": f"c{c}-{session % 2}"}))
    return _touch("array", "shape", rows, found, ("array",) * 6, None)


def make_camera(seed: int = 0, trials: int = 48) -> TouchSet:
    """Return imprints that creep in two cameras; those that slip creep a little faster."""
    rng = np.random.default_rng(seed)
    rows, found = [], []
    at = np.stack(np.meshgrid(np.arange(6), np.arange(8), indexing="ij"), axis=-1).reshape(-1, 2)
    for index in range(trials):
        cup, c = index % 8, (index // 8) % 2
        way = np.cumsum(rng.normal(0.02 + 0.02 * c, 0.1, (ROWS, 2)), axis=0)
        views = []
        for _ in range(2):
            middle = rng.uniform((2, 3), (4, 5)) + way
            near = ((at[None] - middle[:, None]) ** 2).sum(axis=2)
            light = rng.uniform(0.9, 1.1)
            views.append(light * (90 + 40 * np.exp(-near / 3.0)))
        values = np.concatenate(views, axis=1) + rng.normal(0.0, 0.3, (ROWS, 96))
        rows.append(values.astype(np.float32))
        found.append((c, {"cup": f"{cup:02d}"}))
    return _touch("camera", "outcome", rows, found, ("left",) * 48 + ("right",) * 48, (6, 8))


def _touch(kind, target, rows, found, views, squares) -> TouchSet:  # type: ignore[no-untyped-def]
    trials = tuple(
        Trial(
            recording=f"r{i:02d}.mcap",
            start_s=0.0,
            end_s=(ROWS - 1) / 20.0,
            labels={target: f"c{c}"},
            groups={**groups, "recording": f"r{i:02d}", "trial": f"r{i:02d}#0"},
        )
        for i, (c, groups) in enumerate(found)
    )
    return TouchSet(
        kind=kind,
        target=target,
        trials=trials,
        rows=tuple(rows),
        time_s=(np.arange(ROWS) / 20.0,) * len(rows),
        views=views,
        squares=squares,
        created=("",) * len(rows),
        files=({},) * len(rows),
    )


SETS: dict[str, Callable[..., TouchSet]] = {"array": make_array, "camera": make_camera}


@pytest.fixture(params=sorted(SETS))
def system(request: pytest.FixtureRequest) -> TouchSet:
    """Each of the two systems."""
    return SETS[request.param]()


@pytest.fixture
def make_set() -> dict[str, Callable[..., TouchSet]]:
    """What makes each system's set from a seed."""
    return SETS
