"""Sweeps over faults and conditions: what must fall falls, and pairs are pairs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.evaluation.robustness.array_sweep import plan_array, sweep_array
from taxel.evaluation.robustness.conditions import (
    BASE,
    LEVELS,
    NewSessions,
    plan_conditions,
    settings_at,
    simulate_at,
    sweep_conditions,
)
from taxel.evaluation.robustness.touches import Model, Recorded, judge, train_model
from taxel.training.recipes import find_recipe
from taxel.windows.config import WindowConfig

FEW = NewSessions(seed=11, sessions=2, scans=12_500)


def test_heavy_noise_costs_more_than_light_noise_and_missing_channels_answer_nothing(
    model: Model, touches: list[Recorded]
):
    points = sweep_array(model, touches, {"noise": (60.0, 0.0), "missing": (1.0,)})
    none, light, heavy, missing = points

    assert none.fault == "none"
    assert none.answered > 0.9
    assert light.accuracy == pytest.approx(none.accuracy, abs=0.03)
    assert heavy.accuracy < none.accuracy - 0.1
    assert heavy.outside > none.outside  # noise alone opens the gate
    assert missing.answered == 0.0
    assert missing.windows == pytest.approx(none.windows, rel=0.05)


def test_a_sweep_repeats_itself_and_another_seed_differs(model: Model, touches: list[Recorded]):
    plan = {"noise": (12.0,)}
    first, again = (sweep_array(model, touches, plan)[1] for _ in range(2))
    other = sweep_array(model, touches, plan, seed=1)[1]

    assert first == again
    assert other != first


def test_an_array_without_gate_full_scale_or_reference_is_swept_too(
    seen: Path, touches: list[Recorded]
):
    """Angles beside volts, whole touches as windows, and a limit that nobody knows."""
    window = WindowConfig(steps=40, stride=40, grid_hz=None, max_gap_s=10.0, pad=True, tare=True)
    recipe = replace(find_recipe("icub-grasp"), window=window, model="extra-trees", target="shape")
    own = train_model(seen, recipe)
    sensor = replace(touches[0].sensor, full_scale=None)
    odd = [replace(touch, sensor=sensor) for touch in touches]
    points = sweep_array(own, odd, {"hum": (20.0,), "saturation": (50.0,), "noise": (0.0,)})

    assert points[0].answered > 0.99
    assert all(np.isfinite(point.accuracy) for point in points)
    assert points[3].accuracy < points[0].accuracy


def test_a_slow_clock_is_compared_with_the_windows_that_it_leaves(
    model: Model, touches: list[Recorded]
):
    """Every second scan: half the windows, and beside them the first half of each touch's."""
    none, half = sweep_array(model, touches, {"skew": (500_000,)})
    clean = judge(model, touches)
    few = judge(model, [replace(touch, samples=touch.samples[::2]) for touch in touches])
    first = [
        right for number in np.unique(clean.trial)
        for right in clean.right[clean.trial == number][: (few.trial == number).sum()]
    ]  # fmt: skip

    assert half.windows < 0.8 * none.windows
    assert none.base is None
    assert half.base is not None
    assert half.base == pytest.approx(np.mean(first), abs=0.05)
    assert half.beside(none.accuracy) - none.accuracy == pytest.approx(half.accuracy - half.base)


def test_no_faults_named_means_all_and_levels_are_for_those_named():
    assert len(plan_array()) > 12
    assert plan_array(["hum"], [3.0]) == {"hum": (3.0,)}
    assert plan_array(["noise"], [10, 30, 20]) == {"noise": (30, 20, 10)}  # the mildest first
    assert plan_conditions(["dust"]) == {"dust": LEVELS["dust"][1]}
    with pytest.raises(BadInput, match="conditions among temperature"):
        plan_conditions(["rain"])


def test_a_small_array_is_swept_over_the_faults_that_it_can_have():
    assert plan_array(["dead"], channels=3) == {"dead": (1, 2, 3)}
    assert "swapped" not in plan_array(channels=1)
    assert plan_array(["swapped", "dead"], channels=1) == {"dead": (1,)}
    with pytest.raises(BadInput, match="pairs"):
        plan_array(["swapped"], channels=1)


def test_draws_are_reported_beside_the_windows_that_they_multiply(
    model: Model, touches: list[Recorded]
):
    none, dead = sweep_array(model, touches, {"dead": (0,)})

    assert (none.draws, dead.draws) == (1, 4)
    assert dead.windows == 4 * none.windows


def test_a_condition_has_the_same_grasps_and_gains_as_the_base():
    """Warm sessions are the base's, times one factor: forces, objects and order are the same."""
    base, warm = (simulate_at(s, FEW) for s in (BASE, settings_at("temperature", 35.0)))
    for cold, hot in zip(base, warm, strict=True):
        assert [t.labels for t in cold.trials] == [t.labels for t in hot.trials]
        assert [t.groups["force_n"] for t in cold.trials] == [
            t.groups["force_n"] for t in hot.trials
        ]
        high = (cold.samples.values > 1.0) & (cold.samples.values < 3.0)
        ratio = hot.samples.values[high] / cold.samples.values[high]
        assert np.median(ratio) == pytest.approx(1 - 0.004 * 12, abs=0.01)


def test_the_base_is_still_and_moving_sessions_move():
    base, moving = (simulate_at(s, FEW) for s in (BASE, settings_at("moving", 1.0)))

    assert {t.groups["moving"] for touch in base for t in touch.trials} == {"no"}
    assert {t.groups["moving"] for touch in moving for t in touch.trials} == {"yes"}


def test_conditions_are_judged_beside_the_base(model: Model):
    points = sweep_conditions(model, {"dust": (0.5,)}, FEW)

    assert [point.fault for point in points] == ["none", "dust"]
    assert points[1].windows < points[0].windows  # weaker touches stay below the gate
    assert points[0].accuracy > 0.4


def test_a_condition_outside_the_simulators_limits_is_refused(model: Model):
    with pytest.raises(BadInput, match="dust within 0 and 1"):
        sweep_conditions(model, {"dust": (1.5,)}, FEW)


@pytest.mark.parametrize(
    ("condition", "level", "key"), [("force", 2.0, "force_n"), ("size", 24.0, "size_mm")]
)
def test_force_and_size_are_those_asked_for_and_nothing_else_is_drawn_anew(
    condition: str, level: float, key: str
):
    base, changed = (simulate_at(s, FEW) for s in (BASE, settings_at(condition, level)))
    for touch, other in zip(base, changed, strict=True):
        assert {float(trial.groups[key]) for trial in other.trials} == {level}
        assert [t.labels for t in touch.trials] == [t.labels for t in other.trials]
        assert [t.start_s for t in touch.trials] == [t.start_s for t in other.trials]


def test_angle_and_wear_change_the_values_and_not_the_grasps():
    base, *others = (
        simulate_at(s, FEW)
        for s in (BASE, settings_at("angle", 30.0), settings_at("fatigue", 30_000.0))
    )
    for changed in others:
        for touch, other in zip(base, changed, strict=True):
            assert [t.start_s for t in touch.trials] == [t.start_s for t in other.trials]
            assert not np.array_equal(touch.samples.values, other.samples.values)
    worn = np.mean([s.samples.values.mean() for s in others[1]])
    assert worn < 0.7 * np.mean([s.samples.values.mean() for s in base])
