"""Claims about the closed loop: the real monitor, a simulated gripper, the same seeds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gel_monitor import write_gel_monitor

from taxel.actions.grip_policy import (
    GripPolicy,
    GripPolicyConfig,
    PixelDifference,
    PixelDifferenceConfig,
)
from taxel.bench.closed_loop.gels import grips_on_both_gels
from taxel.bench.closed_loop.scores import LoopCase, LoopScores, score_loops
from taxel.bench.closed_loop.tuning import (
    RunProbabilities,
    choose,
    play_alarms,
    stability_at,
    thin,
    tune_loop,
)
from taxel.bundles.grasp import GraspBundle, read_grasp_bundle
from taxel.bundles.shipped import BOTH_GELS, CUP_POUR, DEFAULT_WARNING, shipped_bundle
from taxel.errors import BadInput
from taxel.live.closed_loop import (
    GripCommand,
    LoopConfig,
    LoopTrack,
    MonitoredGrip,
    PixelGrip,
    at_full_force,
    open_pour,
    replay_loop,
    run_loop,
)
from taxel.live.grasp_monitor import GraspMonitor
from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.state import TRUTH_CHANNELS

SHORT = LoopConfig(duration_s=3.0)
DROPS = next(
    run
    for run in list_runs(CupPourConfig(cups=1, first_cup=4008, forces_n=(15.0,)))
    if run.position == "lower"
)
"""Dropped after 2.6 s without taxel."""
HOLDS = replace(DROPS, kind="still", flow_g_s=0.0, amount_g=0.0)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> GraspBundle:
    """A whole grasp bundle whose head is a rule that can be read."""
    path: Path = tmp_path_factory.mktemp("loop") / "b.taxel"
    write_gel_monitor(path)
    return read_grasp_bundle(path)


def close(
    bundle: GraspBundle, run: PourRun, config: LoopConfig = SHORT, *, own: bool = False
) -> LoopTrack:
    """Pour with the monitor and the grip; `own`: at the bundle's own thresholds."""
    pour = open_pour(run, config)
    monitor = GraspMonitor(bundle, pour.cameras, None if own else stability_at(0.5, 0.05))
    return run_loop(pour, MonitoredGrip(monitor, GripPolicy(run.force_n)), config)


@pytest.fixture(scope="module")
def held(bundle: GraspBundle) -> LoopTrack:
    return close(bundle, DROPS)


def test_a_cup_that_drops_without_taxel_is_saved_by_the_monitor_and_the_grip(
    held: LoopTrack,
) -> None:
    bare = replay_loop(DROPS, SHORT)
    assert bare.dropped
    assert not at_full_force(DROPS, SHORT).dropped
    assert not held.dropped
    assert held.force_n[-1] == pytest.approx(50.0, abs=0.1)
    raised_s, slips_s = held.raised_s, bare.slips_s()
    assert raised_s is not None
    assert slips_s is not None
    assert slips_s < raised_s < bare.time_s[-1]


@pytest.mark.slow
@pytest.mark.parametrize("name", [DEFAULT_WARNING, CUP_POUR])
def test_a_monitor_that_comes_with_taxel_saves_the_cup_and_leaves_one_that_holds_alone(
    name: str,
) -> None:
    """At its own thresholds, which are those of a promise of false alarms."""
    shipped = read_grasp_bundle(shipped_bundle(name))
    saved, still = (close(shipped, run, own=True) for run in (DROPS, HOLDS))

    assert not saved.dropped
    assert saved.raised_s is not None
    assert still.raised_s is None
    assert not still.dropped


def test_gels_that_shear_look_otherwise_in_the_loop_while_the_cup_moves_alike() -> None:
    short = LoopConfig(duration_s=0.2)
    pours = [open_pour(DROPS, replace(short, gel=gel)) for gel in (1, 2)]
    images, truths = [], []
    while not pours[0].ended:
        steps = [pour.step() for pour in pours]
        images += [tuple(frame.jpeg for frame in frames) for frames, _ in steps]
        truths.append([samples.values[0][: len(TRUTH_CHANNELS)] for _, samples in steps])

    rigid, shearing = images[::2], images[1::2]
    assert [len(frames) for frames in rigid] == [len(frames) for frames in shearing]
    assert rigid != shearing
    np.testing.assert_array_equal(*np.array(truths).swapaxes(0, 1))


@pytest.mark.slow
def test_grips_on_both_gels_are_counted_for_each_warning_and_each_gel() -> None:
    rows = {row.name: row for row in grips_on_both_gels(workers=1, runs=[DROPS])}

    assert len(rows) == 12
    for gel in ("rigid gels", "gels that shear"):
        name = f"{BOTH_GELS} as it comes, {gel}"
        assert rows[f"{name}: preventable drops prevented"].value == 1.0
        assert "1 of 1 in 1 pour of 1 cup" in rows[f"{name}: preventable drops prevented"].note
        assert rows[f"{name}: raised needlessly in pours that hold"].value is None


def test_until_the_first_raise_arrives_the_pour_is_the_one_without_taxel(
    held: LoopTrack,
) -> None:
    bare = replay_loop(DROPS, SHORT)
    assert held.raised_s is not None
    before = held.time_s < held.raised_s + SHORT.response.latency_s
    np.testing.assert_array_equal(held.truth[before], bare.truth[: before.sum()])
    after = np.flatnonzero(~before)[4]
    assert not np.array_equal(held.truth[after], bare.truth[after])


def test_the_commands_alone_give_the_same_pour_again(held: LoopTrack) -> None:
    again = replay_loop(DROPS, SHORT, held.commands)
    np.testing.assert_allclose(again.truth, held.truth, atol=1e-4)
    assert again.commands == held.commands


def test_a_command_is_given_only_after_arrival_and_inference(
    bundle: GraspBundle, held: LoopTrack
) -> None:
    slow = close(bundle, DROPS, replace(SHORT, inference_s=0.12))
    assert held.raised_s is not None
    assert slow.raised_s == pytest.approx(held.raised_s + 0.10)


def test_a_cup_that_stands_still_is_left_alone(bundle: GraspBundle) -> None:
    track = close(bundle, HOLDS, replace(SHORT, duration_s=1.5))
    assert track.commands == ()
    assert track.holds
    assert track.mean_force_n == pytest.approx(15.0)
    assert len(track.latencies_s) == 90


def test_a_difference_of_pixels_raises_before_anything_slips() -> None:
    config = replace(SHORT, duration_s=2.4)
    pour = open_pour(DROPS, config)
    policy = PixelDifference(15.0, 2, 60.0, PixelDifferenceConfig(threshold=1.5))
    track = run_loop(pour, PixelGrip(policy), config)
    slips_s = replay_loop(DROPS, config).slips_s()
    assert slips_s is not None
    assert DROPS.start_s < (track.raised_s or 0.0) < slips_s


def test_a_person_who_stops_pouring_in_time_saves_the_cup_too() -> None:
    assert not replay_loop(DROPS, SHORT, stop_pouring_s=1.9).dropped


# What a loop is worth: closed forms over made-up tracks.


def track(
    *, cup: int = 0, slip_um: float = 0.0, dropped: bool = False, raised_s: float | None = None
) -> LoopTrack:
    truth = np.zeros((11, 8))
    truth[:, 0] = np.linspace(0.0, slip_um, 11)
    truth[-1, 7] = dropped
    commands = () if raised_s is None else (GripCommand(time_s=raised_s, force_n=50.0),)
    return LoopTrack(
        run=replace(DROPS, cup=replace(DROPS.cup, index=cup)),
        time_s=np.arange(11) / 10,
        truth=truth,
        force_n=np.full(11, 15.0 if raised_s is None else 30.0),
        commands=commands,
    )


SLID = track(slip_um=1000.0)
LOST = track(slip_um=1000.0, dropped=True)
STILL = track(slip_um=200.0)
RAISED = track(slip_um=200.0, raised_s=0.5)


def test_only_drops_that_full_force_prevents_count() -> None:
    scores = score_loops(
        [
            LoopCase(bare=LOST, full=STILL, held=RAISED),
            LoopCase(bare=LOST, full=STILL, held=LOST),
            LoopCase(bare=LOST, full=LOST, held=LOST),
            LoopCase(bare=STILL, full=STILL, held=RAISED),
            LoopCase(bare=STILL, full=STILL, held=STILL),
            LoopCase(bare=SLID, full=STILL, held=RAISED),
            LoopCase(bare=STILL, full=STILL, held=LOST),
        ]
    )
    assert (scores.drops, scores.preventable, scores.prevented) == (3, 2, 1)
    assert (scores.holds, scores.needless) == (3, 1)
    assert (scores.slides, scores.slides_raised, scores.caused) == (1, 1, 1)
    assert scores.prevented_share == 0.5
    assert scores.force_n == pytest.approx((3 * 30 + 4 * 15) / 7)
    # 100 of 1000 µm are passed at the second moment after the first tenth: 0.2 s.
    assert scores.slip_to_raise_s == pytest.approx(0.3)


def test_an_interval_never_says_more_than_an_exact_binomial() -> None:
    """Twenty of twenty: the exact lower bound is 0.025 to the power of one in twenty."""
    cases = [
        LoopCase(bare=replace(LOST, run=tracked.run), full=STILL, held=tracked)
        for tracked in (track(cup=i, raised_s=0.5) for i in range(20))
    ]
    low, high = score_loops(cases).prevented_interval
    assert low == pytest.approx(0.025 ** (1 / 20))
    assert high == 1.0


def test_no_pours_have_no_scores() -> None:
    with pytest.raises(BadInput):
        score_loops([])


def test_a_thinned_track_scores_the_same() -> None:
    bare = replay_loop(DROPS, SHORT)
    small = thin(bare)
    assert len(small.time_s) <= 4
    assert (small.dropped, small.slips_s(), small.raised_s) == (True, bare.slips_s(), None)
    assert small.slip_um == bare.slip_um
    assert small.mean_force_n == pytest.approx(bare.mean_force_n)


def scored(prevented: float, needless: float) -> LoopScores:
    (scores,) = [score_loops([LoopCase(bare=STILL, full=STILL, held=STILL)])]
    return replace(
        scores, preventable=100, prevented=round(100 * prevented), holds=100,
        needless=round(100 * needless), prevented_share=prevented, needless_share=needless,
    )  # fmt: skip


def test_the_middle_of_the_best_plateau_is_chosen() -> None:
    curve = [scored(1.0, 0.2), *[scored(1.0, 0.01)] * 5, scored(0.9, 0.0)]
    assert choose(curve) == 3


def test_the_middle_is_that_of_the_debounce_with_the_widest_plateau() -> None:
    good, bad = scored(1.0, 0.01), scored(0.9, 0.0)
    family = [0.0] * 5 + [0.1] * 5
    curve = [good, good, bad, bad, bad, bad, good, good, good, bad]
    assert choose(curve, None, family) == 7


def test_tuning_finds_the_threshold_that_saves_the_cup_and_leaves_the_other_alone() -> None:
    """Probabilities are made up: the cup that drops shows 0.75 from 2 s on, the still one 0.45."""
    time_s = np.arange(29, 360) / 60
    falling = np.where(time_s < 2.0, 0.05, 0.75)
    calm = np.where(time_s < 1.0, 0.05, 0.45)
    tracks = [
        RunProbabilities(run=DROPS, time_s=time_s, probabilities=falling),
        RunProbabilities(run=HOLDS, time_s=time_s, probabilities=calm),
    ]
    stability, curve = tune_loop(tracks, SHORT, workers=1)
    assert 0.45 < stability.warn <= 0.75
    best = next(point.scores for point in curve if point.stability == stability)
    assert (best.prevented, best.needless) == (1, 0)
    loose = next(point.scores for point in curve if point.stability.warn == 0.1)
    assert loose.needless == 1


@pytest.mark.slow
def test_the_grip_is_raised_at_the_alarm_and_then_follows_the_slip_as_played() -> None:
    time_s = np.arange(360) / 60
    track = RunProbabilities(
        run=DROPS, time_s=time_s, probabilities=np.where(time_s < 1.5, 0.1, 0.99)
    )
    config, policy = LoopConfig(), GripPolicyConfig()
    ((held, person),) = play_alarms(track, [stability_at(0.5, 0.0)], config, policy)
    first = held.held.commands[0]
    assert first.time_s == pytest.approx(1.5 + 0.004 + 0.020)
    assert first.force_n == DROPS.force_n + policy.slip_step_n
    assert held.preventable
    assert not held.held.dropped
    deaf = replace(policy, slip_advance_mm=1e6, lost_mm=1e6)
    ((once, _),) = play_alarms(track, [stability_at(0.5, 0.0)], config, deaf)
    assert len(held.held.commands) > len(once.held.commands) == 1
    assert held.held.slip_um < 0.6 * once.held.slip_um
    assert person.held.commands == ()


def test_of_two_thresholds_the_one_that_leaves_the_person_time_is_chosen() -> None:
    curve = [scored(1.0, 0.01), scored(1.0, 0.0)]
    assert choose(curve) == 1
    assert choose(curve, [scored(0.9, 0.0), scored(0.5, 0.0)]) == 0
