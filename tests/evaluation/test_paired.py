"""Paired tests of two runs: exact where they can be, honest about how few sessions there are."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from taxel.bundles.contract import Contract
from taxel.errors import BadInput
from taxel.evaluation.intervals import ratio_interval
from taxel.evaluation.paired import (
    compare_runs,
    mcnemar,
    sign_flip,
    smallest_p,
)
from taxel.labels.trials import Trial
from taxel.training.loop import TrainConfig
from taxel.training.predictions import Predictions
from taxel.training.run import Run
from taxel.windows.config import WindowConfig
from taxel.windows.scaling import Scaling

WINDOWS_A_SESSION = 40


def make_run(
    right: list[float],
    *,
    seed: int = 0,
    split: str = "session held out",
    digest: str = "abc",
    target: str = "shape",
) -> Run:
    """Return a run whose share of windows predicted correctly is given for each session."""
    rng = np.random.default_rng(seed)
    trials = tuple(
        Trial(
            recording=f"s{s}.mcap",
            start_s=10.0 * g,
            end_s=10.0 * g + 9.0,
            labels={"shape": "ball"},
            groups={"session": f"s{s}", "grasp": f"s{s}/{g}", "trial": f"s{s}#{g}"},
        )
        for s in range(len(right))
        for g in range(4)
    )
    n = len(right) * WINDOWS_A_SESSION
    session = np.repeat(np.arange(len(right)), WINDOWS_A_SESSION)
    trial = session * 4 + np.tile(np.arange(WINDOWS_A_SESSION) // 10, len(right))
    y = rng.integers(0, 2, n)
    correct = np.concatenate(
        [np.arange(WINDOWS_A_SESSION) < round(share * WINDOWS_A_SESSION) for share in right]
    )
    predicted = np.where(correct, y, 1 - y)
    scaling = Scaling(kind="none", offset=np.zeros(1, np.float32), factor=np.ones(1, np.float32))
    contract = Contract(
        target=target,
        classes=("ball", "box"),
        window=WindowConfig(),
        scaling=scaling,
        channels=("a",),
        units=("V",),
        rate_hz=100.0,
        model="cnn2d",
        parameters=1,
        data_digest=digest,
        accuracy={},
        software="taxel",
        parity=None,
    )
    return Run(
        networks=(),
        contract=contract,
        train=TrainConfig(),
        history=(),
        data="data",
        predictions=Predictions(
            split=split,
            classes=("ball", "box"),
            trials=trials,
            folds=tuple(f"without s{s}" for s in range(len(right))),
            trained=np.zeros((len(right), len(trials)), np.intp),
            trial=trial,
            start_s=np.arange(n) * 0.1,
            fold=session,
            y=y,
            probabilities=np.stack([1.0 - predicted, predicted], axis=1).astype(float),
        ),
    )


def test_mcnemar_is_the_binomial_of_the_windows_that_one_run_alone_gets_right():
    assert mcnemar(0, 5) == pytest.approx(2 / 32)
    assert mcnemar(3, 3) == 1.0
    assert mcnemar(0, 0) == 1.0


def test_sign_flip_goes_through_all_signs():
    changed = np.array([3.0, -1.0, 4.0, 0.0, 2.0])
    sums = [abs(np.dot(signs, changed)) for signs in product((1, -1), repeat=5)]

    assert sign_flip(changed) == pytest.approx(np.mean(np.array(sums) >= 8.0))


def test_drawn_signs_come_near_all_signs():
    rng = np.random.default_rng(1)
    few = rng.normal(0.3, 1.0, 16)
    exact = sign_flip(few)
    drawn = sign_flip(np.concatenate([few, np.zeros(4)]))  # zeros change nothing, but 20 are drawn

    assert drawn == pytest.approx(exact, abs=0.01)


@pytest.mark.parametrize("groups", [1, 5, 16, 30, 60])
def test_the_smallest_p_is_reached_where_every_group_gains(groups: int):
    """And not below: signs that are drawn cannot show 2^-59."""
    assert sign_flip(np.ones(groups)) == pytest.approx(smallest_p(groups), rel=1e-12)


def test_sign_flip_keeps_its_promise_where_nothing_differs():
    """Under no difference, p below 0.05 comes up in at most 5 % of data sets."""
    rng = np.random.default_rng(2)
    found = np.array([sign_flip(rng.normal(0, rng.uniform(1, 20), 8)) for _ in range(600)])

    assert (found < 0.05).mean() <= 0.07


def test_the_interval_of_the_difference_covers_the_truth():
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(100):
        changed = rng.normal(4.0, 6.0, 20)
        low, high = ratio_interval(changed, np.full(20, 40))
        hits += low <= 0.1 <= high

    assert hits >= 87


def test_a_gain_in_every_one_of_eight_sessions_is_claimed():
    found = compare_runs(make_run([0.5] * 8), make_run([0.6, 0.7, 0.65, 0.6, 0.7, 0.6, 0.7, 0.6]))

    assert found.difference == pytest.approx(0.14375)
    assert found.p_groups == pytest.approx(2 / 2**8)
    assert found.interval[0] > 0.1
    assert found.verdict.startswith("The second run is better by 14.4 points over 8 sessions")


def test_with_five_sessions_no_difference_can_be_claimed_however_large():
    found = compare_runs(make_run([0.2] * 5), make_run([0.9] * 5))

    assert found.p_windows < 1e-20
    assert found.p_groups == found.smallest_p == pytest.approx(0.0625)
    assert "No difference can be claimed with 5 sessions: the smallest possible p is 0.062" in (
        found.verdict
    )
    assert "promises too much" in found.verdict


def test_a_gain_in_one_session_alone_is_no_gain_though_windows_say_so():
    found = compare_runs(make_run([0.5] * 7), make_run([1.0, *[0.5] * 6]))

    assert found.p_windows < 1e-4
    assert found.p_groups == 1.0
    assert "No difference can be claimed: p = 1" in found.verdict


def test_one_session_says_nothing():
    found = compare_runs(make_run([0.5]), make_run([0.9]), group="session")

    assert "of one session" in found.verdict
    assert np.isnan(found.interval).all()


def test_equal_runs_are_said_to_be_equal():
    run = make_run([0.5, 0.7])

    assert "the very same windows" in compare_runs(run, run).verdict


def test_a_finer_group_than_the_session_is_warned_of():
    found = compare_runs(make_run([0.5] * 3), make_run([0.9] * 3), group="grasp")

    assert len(found.groups) == 12
    assert "Grasps of one session are alike" in found.verdict


def test_a_leaking_split_is_named_in_the_verdict():
    split = "random windows (leaks)"
    found = compare_runs(make_run([0.5] * 6, split=split), make_run([0.9] * 6, split=split))

    assert "The split leaks" in found.verdict


def test_the_order_of_windows_does_not_matter():
    first, second = make_run([0.5, 0.6, 0.7]), make_run([0.8, 0.4, 0.9])
    assert second.predictions is not None
    order = np.random.default_rng(0).permutation(len(second.predictions))
    mixed = replace(
        second.predictions,
        **{
            name: getattr(second.predictions, name)[order]
            for name in ("trial", "start_s", "fold", "y", "probabilities")
        },
    )

    assert compare_runs(first, replace(second, predictions=mixed)) == compare_runs(first, second)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (make_run([0.5, 0.5], digest="xyz"), "recordings"),
        (make_run([0.5, 0.5], target="material"), "target"),
        (make_run([0.5, 0.5], split="file held out"), "split"),
        (make_run([0.5, 0.5, 0.5]), "same test windows"),
        (replace(make_run([0.5, 0.5]), predictions=None), "predictions"),
    ],
)
def test_runs_that_were_not_tested_alike_are_refused(other: Run, message: str):
    with pytest.raises(BadInput, match=message):
        compare_runs(make_run([0.5, 0.5]), other)


def test_runs_with_other_folds_are_refused():
    run = make_run([0.5, 0.5])
    assert run.predictions is not None
    moved = replace(run.predictions, fold=1 - run.predictions.fold)

    with pytest.raises(BadInput, match=r"same folds.*--fold-count, or with one table of --folds"):
        compare_runs(run, replace(run, predictions=moved))


def test_a_group_that_is_not_there_is_refused():
    with pytest.raises(BadInput, match="'object'"):
        compare_runs(make_run([0.5]), make_run([0.5]), group="object")


def test_objects_that_were_held_out_over_several_sessions_are_taken_as_wholes():
    def held(run: Run) -> Run:
        assert run.predictions is not None
        trials = tuple(
            replace(trial, groups={**trial.groups, "object": trial.groups["grasp"][-1]})
            for trial in run.predictions.trials
        )
        return replace(
            run, predictions=replace(run.predictions, trials=trials, split="object held out")
        )

    first, second = make_run([0.5, 0.6, 0.7]), make_run([0.6, 0.7, 0.8])
    found = compare_runs(held(first), held(second))
    assert (found.group, len(found.groups)) == ("object", 4)
    assert compare_runs(first, second).group == "session"


def test_runs_with_other_labels_on_the_same_windows_are_refused():
    """The same values imported again with corrected labels have the same digest."""
    run = make_run([0.5, 0.5])
    assert run.predictions is not None
    y = run.predictions.y.copy()
    y[:3] = 1 - y[:3]
    relabelled = replace(run, predictions=replace(run.predictions, y=y))

    with pytest.raises(BadInput, match="same labels; got 3 of 80 windows with another class"):
        compare_runs(run, relabelled)


@pytest.mark.parametrize(("there", "changed"), [("s0", 40), (None, 80)])
def test_runs_with_other_sessions_on_the_same_windows_are_refused(there: str | None, changed: int):
    run = make_run([0.5, 0.5])
    assert run.predictions is not None
    given = {} if there is None else {"session": there}
    trials = tuple(
        replace(t, groups={k: v for k, v in t.groups.items() if k != "session"} | given)
        for t in run.predictions.trials
    )
    other = replace(run, predictions=replace(run.predictions, trials=trials))

    for pair in ((run, other), (other, run)):
        with pytest.raises(BadInput, match=f"same .*sessions.*{changed} of 80"):
            compare_runs(*pair)
    assert compare_runs(run, run, group="grasp").group == "grasp"
