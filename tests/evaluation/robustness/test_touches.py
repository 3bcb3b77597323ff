"""What is judged offline equals a data set's windows and the live path's answers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.contract import at_level
from taxel.decisions.recognition import UNKNOWN, GraspVote, Quality, decide
from taxel.decisions.unknown import NoveltyTest
from taxel.errors import BadBundle, BadDataset
from taxel.evaluation.robustness.touches import (
    ANSWER_ALL,
    Model,
    Recorded,
    judge,
    read_touches,
    train_model,
)
from taxel.signals import Samples, Validity
from taxel.training.recipes import find_recipe
from taxel.training.unknown import fit_unknown
from taxel.windows.dataset import load_dataset
from taxel.windows.reference import touch_level


def test_windows_are_those_of_a_data_set_brought_to_the_trained_level(
    model: Model, unseen: Path, touches: list[Recorded]
):
    """One session at a time, whose own level a data set then keeps."""
    assert model.contract.reference is not None
    right = total = 0
    for file in sorted(unseen.glob("*.mcap")):
        dataset = load_dataset(file, model.contract.window, target="shape")
        assert dataset.reference is not None
        moved = dataset.windows.values * (model.contract.reference.level / dataset.reference.level)
        found = model.probabilities(moved.astype(np.float32), dataset.windows.mask)
        right += int((found.argmax(axis=1) == dataset.class_numbers("shape")).sum())
        total += len(dataset)
    answers = judge(model, touches)

    assert len(answers.y) == total
    assert int(answers.right.sum()) == right
    assert answers.right.mean() > 0.5  # it has learned something: a guess is right in a third


def test_levels_that_follow_are_followed_as_where_recordings_are_scored(seen: Path, unseen: Path):
    """With values as measured, the recogniser would be given what it never learned from."""
    recipe = find_recipe("teng-referenced")
    window = replace(recipe.window, reference=None, level_follow="session:10")
    follows = train_model(seen, replace(recipe, model="extra-trees", window=window))
    dataset = load_dataset(unseen, window, target="shape", usual=follows.contract.usual)
    found = follows.probabilities(dataset.windows.values, dataset.windows.mask)
    right = found.argmax(axis=1) == dataset.class_numbers("shape")
    answers = judge(follows, read_touches(unseen)[0])

    assert len(answers.y) == len(dataset)
    np.testing.assert_allclose(answers.probabilities, found, atol=1e-6)
    assert int(answers.right.sum()) == int(right.sum())


def test_a_sessions_level_gives_what_a_bundle_adapted_to_it_gives(
    model: Model, touches: list[Recorded]
):
    from taxel.windows.windower import cut_windows

    session = touches[0]
    windows = cut_windows(session.samples, model.contract.window, session.sensor)
    own = np.zeros(len(windows), bool)
    first = [t for t in session.trials if t.groups["object"] == "cylinder-glass"][:3]
    for trial in first:
        own |= (windows.start_s >= trial.start_s) & (windows.end_s <= trial.end_s)
    level = touch_level(windows.values[own], windows.mask[own])
    adapted = at_level(model.contract, level).scaling.apply(windows.values, windows.mask)
    assert model.contract.reference is not None
    factor = model.contract.reference.level / level
    here = model.contract.scaling.apply(windows.values * factor, windows.mask)

    np.testing.assert_allclose(adapted, here, rtol=1e-5, atol=1e-6)


def test_reference_touches_are_never_judged(model: Model, touches: list[Recorded]):
    answers = judge(model, touches)

    assert len(answers.grasps) == sum(len(touch.trials) - 3 for touch in touches)


def test_a_recording_that_lost_every_scan_answers_nothing(model: Model, touches: list[Recorded]):
    """As a short one may by the fault of lost scans."""
    last = replace(touches[-1], samples=touches[-1].samples[:0])
    answers, sound = judge(model, [*touches[:-1], last]), judge(model, touches[:-1])
    assert len(answers.y) == len(sound.y)
    assert len(answers.grasps) >= len(sound.grasps)


def test_sessions_within_one_recording_have_levels_of_their_own(
    model: Model, touches: list[Recorded]
):
    """Two sessions in one file, as an import may have them, are told as in two files."""
    first, second = touches[:2]
    later_s = float(first.samples.fitted_s[-1]) + 10.0
    moved = replace(second.samples, fitted_s=second.samples.fitted_s + later_s)
    trials = [replace(t, start_s=t.start_s + later_s, end_s=t.end_s + later_s)
              for t in second.trials]  # fmt: skip
    joined = replace(
        first, samples=Samples.join([first.samples, moved]), trials=(*first.trials, *trials)
    )
    apart, found = judge(model, [first, second]), judge(model, [joined])

    assert found.grasps.tolist() == apart.grasps.tolist()
    assert found.right.mean() == pytest.approx(apart.right.mean(), abs=0.02)


def test_input_that_cannot_be_used_is_not_answered(model: Model, touches: list[Recorded]):
    """From the middle of each session on a channel is missing."""
    half = []
    for touch in touches:
        validity = touch.samples.validity.copy()
        validity[len(validity) // 2 :, 3] |= np.uint8(Validity.MISSING)
        half.append(replace(touch, samples=replace(touch.samples, validity=validity)))
    answers = judge(model, half, replace(ANSWER_ALL, most_saturated=1.0))

    assert 0.2 < answers.answered.mean() < 0.8
    for session in set(answers.session.tolist()):
        own = answers.session == session
        heard, silent = (answers.trial[own & (answers.answered == flag)] for flag in (True, False))
        assert heard.max() <= silent.min()


def test_a_session_without_a_usable_reference_touch_is_not_answered(
    model: Model, touches: list[Recorded]
):
    validity = touches[0].samples.validity | np.uint8(Validity.MISSING)
    broken = replace(touches[0], samples=replace(touches[0].samples, validity=validity))
    answers = judge(model, [broken, *touches[1:]])

    assert not answers.answered[answers.session == broken.sessions[0]].any()
    assert answers.answered[answers.session != broken.sessions[0]].mean() > 0.95


def test_too_few_reference_touches_are_refused(model: Model, touches: list[Recorded]):
    short = replace(touches[0], trials=touches[0].trials[:4])
    with pytest.raises(BadDataset, match="3 touches of object=cylinder-glass"):
        judge(model, [short])


def test_another_array_is_refused(model: Model, touches: list[Recorded]):
    sensor = touches[0].sensor.only(touches[0].sensor.channels[:5])
    other = replace(touches[0], sensor=sensor, samples=touches[0].samples.only([0, 1, 2, 3, 4]))
    with pytest.raises(BadBundle, match="12 channels"):
        judge(model, [other])


def test_touches_of_kinds_that_the_model_does_not_know_are_left_out(
    model: Model, touches: list[Recorded]
):
    odd = [
        replace(touch, trials=tuple(
            replace(t, labels={**t.labels, "shape": "prism"}) if t.labels["shape"] == "sphere"
            else t for t in touch.trials
        ))
        for touch in touches
    ]  # fmt: skip
    answers = judge(model, odd)

    sphere = model.contract.classes.index("sphere")
    assert len(answers.y) < len(judge(model, touches).y)
    assert not (answers.y == sphere).any()


@pytest.mark.slow
def test_what_a_bundles_own_test_calls_unknown_is_not_answered_as_live(
    model: Model, seen: Path, unseen: Path, touches: list[Recorded]
):
    """Windows by themselves, and touches as a whole, each as `decide` and `GraspVote` say live."""
    contract = replace(model.contract, reference=None)
    plain = replace(contract.window, reference=None)
    learned = load_dataset(seen, plain, target="shape")
    unknown = fit_unknown(learned, "shape", contract.scaling, 0.3)
    bare = Model(replace(contract, window=plain), model.probabilities)
    strict = Model(replace(bare.contract, unknown=unknown), model.probabilities)
    answers, lenient = judge(strict, touches), judge(bare, touches)
    data, test = load_dataset(unseen, plain), NoveltyTest(unknown)
    votes = {number: GraspVote(contract.classes, 1e9, test) for number in range(len(data.trials))}
    answered, whole = [], {}
    for i, number in enumerate(data.trial.tolist()):
        values, mask = data.windows.values[i : i + 1], data.windows.mask[i : i + 1]
        novelty = test.of_window(contract.scaling.apply(values, mask)[0])
        quality = Quality(saturated=float(data.windows.saturated[i]))
        decision = decide(model.probabilities(values, mask)[0], quality, contract.classes,
                     ANSWER_ALL, novelty, test)  # fmt: skip
        answered.append(decision.label != UNKNOWN)
        whole[number] = votes[number].add(decision)[0] != UNKNOWN

    assert 0.5 < np.mean(answered) < 0.9
    assert answers.answered.mean() == pytest.approx(np.mean(answered), abs=1e-9)
    assert lenient.answered.mean() > 0.99
    assert (
        len(answers.answered_grasps()[0]) == sum(whole.values()) < len(lenient.answered_grasps()[0])
    )


def test_the_digest_is_the_data_sets(model: Model, seen: Path):
    assert read_touches(seen)[1] == model.contract.data_digest


def test_a_sessions_first_touches_are_those_of_its_first_recording(
    model: Model, touches: list[Recorded]
):
    """Given in another order, and each recording with a clock of its own."""
    touch = touches[0]
    half = [t for t in touch.trials if t.groups["object"] == "cylinder-glass"][3].start_s
    parts = [
        replace(touch, trials=tuple(replace(t, recording=name) for t in touch.trials
                                  if (t.start_s < half) == first))
        for name, first in (("a.mcap", True), ("b.mcap", False))
    ]  # fmt: skip

    answers, turned = judge(model, parts), judge(model, parts[::-1])

    assert len(answers.y) == len(turned.y)
    assert answers.right.sum() == turned.right.sum()
    np.testing.assert_allclose(
        np.sort(answers.probabilities.max(axis=1)), np.sort(turned.probabilities.max(axis=1))
    )
