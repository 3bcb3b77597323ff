"""Claims about learning what is usual: it rejects what it promised, and finds what is new."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.decisions.unknown import NoveltyTest, Unknown
from taxel.errors import BadDataset
from taxel.labels.trials import Trial
from taxel.signals import SensorInfo
from taxel.training.unknown import _least_scores, fit_unknown
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import Dataset
from taxel.windows.scaling import Scaling, fit_scaling
from taxel.windows.windower import Windows

STEPS, CHANNELS = 8, 4
CENTRES = {"a": (1.0, 2.0, 1.0, 1.0), "b": (2.0, 1.0, 1.0, 1.0), "new": (2.0, 2.0, 1.0, 1.0)}
WEIGHTS = {"light": 1.0, "heavy": 2.0}


def make(
    kinds: tuple[str, ...] = ("a", "b"),
    sessions: int = 5,
    trials: int = 16,
    windows: int = 4,
    seed: int = 0,
) -> Dataset:
    """Windows about a centre of their class; weight sets how much they change."""
    rng = np.random.default_rng(seed)
    all_trials, owner, values = [], [], []
    for session in range(sessions):
        for number in range(trials):
            kind = kinds[number % len(kinds)]
            weight = ("light", "heavy")[(number // len(kinds)) % 2]
            start = 10.0 * len(all_trials)
            all_trials.append(
                Trial(
                    recording=f"s{session}.mcap", start_s=start, end_s=start + 9.0,
                    labels={"shape": kind, "weight": weight, "shape+weight": f"{kind} {weight}"},
                    groups={"recording": f"s{session}", "session": f"s{session}",
                            "trial": f"{session}/{number}"},
                )
            )  # fmt: skip
            for _ in range(windows):
                noise = rng.normal(0.0, 0.1 * WEIGHTS[weight], (STEPS, CHANNELS))
                values.append(np.array(CENTRES[kind]) + rng.normal(0.0, 0.1, CHANNELS) + noise)
                owner.append(len(all_trials) - 1)
    n = len(values)
    return Dataset(
        windows=Windows(
            np.array(values, np.float32), np.ones((n, STEPS), bool), np.ones(n, np.float32),
            np.zeros(n, np.float32), np.arange(n, dtype=float), np.arange(n) + 0.5,
        ),
        trial=np.array(owner, np.intp),
        trials=tuple(all_trials),
        sensor=SensorInfo(name="t", channels=tuple("abcd"), units=("V",) * 4, rate_hz=100.0,
                          full_scale=3.3),
        config=WindowConfig(steps=STEPS, stride=STEPS),
        digest="0",
        notes=(),
    )  # fmt: skip


def scaling(dataset: Dataset) -> Scaling:
    return fit_scaling("full-scale", dataset.windows.values, dataset.windows.mask, 3.3)


def p_values(unknown: Unknown, dataset: Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return the windows' and the contacts' p-values."""
    test = NoveltyTest(unknown)
    scaled = scaling(dataset).apply(dataset.windows.values, dataset.windows.mask)
    each = [test.of_window(window) for window in scaled]
    contacts = [
        test.p_contact(list(np.mean([each[i] for i in own], axis=0)), len(own))
        for own in (np.flatnonzero(dataset.trial == t) for t in range(len(dataset.trials)))
    ]
    return np.array([test.p_window(window) for window in each]), np.array(contacts)


@pytest.fixture(scope="module")
def learned() -> Unknown:
    dataset = make()
    return fit_unknown(dataset, "shape", scaling(dataset))


def test_known_touch_of_another_day_is_rejected_as_rarely_as_promised(learned: Unknown):
    windows, contacts = p_values(learned, make(seed=1, sessions=10))
    assert 0.02 < (windows <= 0.05).mean() < 0.09
    assert (contacts <= 0.05).mean() < 0.1


def test_a_new_shape_is_found_among_known_channels(learned: Unknown):
    """Each of its channels alone looks like one class or the other."""
    windows, contacts = p_values(learned, make(("new",), seed=2))
    assert (windows <= 0.05).mean() > 0.9
    assert (contacts <= 0.05).mean() == 1.0


def test_directions_that_tell_nothing_apart_are_left_out(learned: Unknown):
    (density,) = learned.densities
    assert density.projection.shape == (3 * CHANNELS, 1)


def test_a_joined_target_is_judged_by_each_of_its_labels():
    dataset = make()
    unknown = fit_unknown(dataset, "shape+weight", scaling(dataset))
    assert [density.label for density in unknown.densities] == ["shape", "weight"]
    windows, _ = p_values(unknown, make(("new",), seed=2))
    assert (windows <= 0.05).mean() > 0.8
    quiet = make(seed=3)
    still = np.broadcast_to(quiet.windows.values.mean(axis=1, keepdims=True),
                            quiet.windows.values.shape)  # fmt: skip
    windows, _ = p_values(unknown, replace(quiet, windows=replace(quiet.windows, values=still)))
    assert (windows <= 0.05).mean() > 0.9


def test_trials_that_may_not_be_used_are_not():
    dataset = make()
    spoilt = make(("new", "a"), seed=5)
    both = replace(
        dataset,
        windows=Windows.join([dataset.windows, spoilt.windows]),
        trial=np.concatenate([dataset.trial, spoilt.trial + len(dataset.trials)]),
        trials=dataset.trials + spoilt.trials,
    )
    used = np.arange(len(both.trials)) < len(dataset.trials)
    with_them = fit_unknown(both, "shape", scaling(dataset), trials=used)
    without = fit_unknown(dataset, "shape", scaling(dataset))
    np.testing.assert_array_equal(with_them.densities[0].windows, without.densities[0].windows)
    np.testing.assert_array_equal(with_them.densities[0].centres, without.densities[0].centres)


def test_no_calibration_window_was_fitted():
    """A session that lies elsewhere is novel to the others, and says so in the calibration."""
    dataset = make()
    values = dataset.windows.values.copy()
    last = np.array([trial.groups["session"] == "s4" for trial in dataset.trials])[dataset.trial]
    values[last] += np.float32(1.5)
    moved = replace(dataset, windows=replace(dataset.windows, values=values))
    fit = fit_unknown(moved, "shape", scaling(dataset))
    usual = fit_unknown(dataset, "shape", scaling(dataset))
    assert fit.densities[0].windows[-20] > usual.densities[0].windows[-1]


def test_too_few_contacts_are_refused_with_the_share_that_they_would_do_for():
    """Windows enough, but of few contacts."""
    few = make(sessions=2, trials=8, windows=8)
    with pytest.raises(BadDataset, match="19 contacts in sessions held out") as caught:
        fit_unknown(few, "shape", scaling(few))
    assert "let 0.06 of known touch" in str(caught.value)
    fit_unknown(few, "shape", scaling(few), rejected=0.06)
    with pytest.raises(BadDataset):
        fit_unknown(few, "shape", scaling(few), rejected=0.055)


def test_a_joined_target_needs_more_for_its_p_is_multiplied():
    some = make(sessions=4, trials=8, windows=4)
    fit_unknown(some, "shape", scaling(some))
    with pytest.raises(BadDataset, match="39 contacts"):
        fit_unknown(some, "shape+weight", scaling(some))


@pytest.mark.parametrize("target", ["shape", "shape+weight"])
@pytest.mark.parametrize("trials", [8, 12, 16])
def test_a_test_that_is_stored_can_fire(target: str, trials: int):
    """Windows and contacts of any number that are novel beyond measure are rejected."""
    dataset = make(sessions=5, trials=trials, windows=2)
    unknown = fit_unknown(dataset, target, scaling(dataset), rejected=0.05)
    test, far = NoveltyTest(unknown), [1e9] * len(unknown.densities)
    assert test.p_window(far) <= test.rejected
    assert all(test.p_contact(far, count) <= test.rejected for count in range(1, 40))


@pytest.mark.parametrize("labels", [1, 2, 3])
def test_the_least_number_lets_p_reach_the_share_and_one_fewer_does_not(labels: int):
    for rejected in (0.001, 0.01, 0.03, 0.05, 0.07, 0.1, 0.2, 0.35, 0.49):
        needed = _least_scores(labels, rejected)
        assert labels * (1 / (1 + needed)) <= rejected
        assert labels / needed > rejected * (1 - 1e-12)


def test_a_small_share_keeps_as_many_scores_as_it_needs():
    dataset = make(sessions=6, trials=200, windows=1)
    unknown = fit_unknown(dataset, "shape", scaling(dataset), rejected=0.0009)
    assert NoveltyTest(unknown).p_window([1e9]) <= 0.0009
