"""Claims about what is called unknown: exact on closed forms, and NumPy alone."""

import json
from dataclasses import replace

import numpy as np
import pytest

from taxel.decisions.recognition import (
    UNKNOWN,
    UNMEASURED,
    Decision,
    GraspVote,
    Quality,
    RecogniseConfig,
    decide,
)
from taxel.decisions.unknown import (
    Density,
    NoveltyTest,
    Summary,
    Unknown,
    p_value,
    summaries,
    unknown_from_json,
    unknown_to_json,
)

CLASSES = ("a", "b")
KNOWN = np.arange(1.0, 100.0)
"""Novelty scores of 99 known windows: p falls by a hundredth from one to the next."""


def level_only(rejected: float = 0.05, labels: tuple[str, ...] = ("shape",)) -> Unknown:
    """One channel whose level alone counts: class a about 0, class b about 4."""
    density = Density(
        label="shape",
        projection=np.array([[1.0], [0.0], [0.0]]),
        centres=np.array([[0.0], [4.0]]),
        log_share=np.log([0.5, 0.5]),
        windows=KNOWN,
        contacts={1: KNOWN, 4: KNOWN / 10.0},
    )
    return Unknown(
        rejected=rejected,
        lag=1,
        level=np.zeros(1),
        wander=np.ones(1),
        least=np.full((2, 1), 1e-6),
        densities=(density,) * len(labels),
    )


def window(level: float) -> np.ndarray:
    return np.full((6, 1), np.sinh(level), np.float32)


def plain(channels: int, lag: int, least: float = 1e-6) -> Unknown:
    return Unknown(
        rejected=0.05, lag=lag, level=np.zeros(channels), wander=np.ones(channels),
        least=np.full((2, channels), least), densities=(),
    )  # fmt: skip


def test_level_variance_and_change_are_what_they_are_called():
    rows = np.random.default_rng(0).normal(2.0, 3.0, (12, 5))
    found = Summary(plain(5, lag=2), 12, np.float64).of(rows).reshape(3, 5)
    np.testing.assert_allclose(np.sinh(found[0]), rows.mean(axis=0))
    np.testing.assert_allclose(np.exp(found[1]), rows.var(axis=0) + 1e-6)
    change = np.abs(rows[2:] - rows[:-2]).mean(axis=0)
    np.testing.assert_allclose(np.exp(found[2]), change + 1e-6)


def test_a_window_of_two_rows_has_the_change_between_them():
    rows = np.array([[3.0, 4.0], [5.0, 4.5]])
    found = Summary(plain(2, lag=1), 2, np.float64).of(rows).reshape(3, 2)
    np.testing.assert_allclose(np.exp(found[2]), [2.0, 0.5], atol=2e-6)


def test_a_window_of_one_row_has_no_change():
    found = Summary(plain(2, lag=4), 1, np.float64).of(np.array([[3.0, 4.0]])).reshape(3, 2)
    np.testing.assert_allclose(np.sinh(found[0]), [3.0, 4.0])
    np.testing.assert_allclose(np.exp(found[1:]), 1e-6)


def test_a_window_shorter_than_the_lag_has_no_change():
    rows = np.array([[3.0, 4.0], [5.0, 4.5]])
    found = Summary(plain(2, lag=4), 2, np.float64).of(rows).reshape(3, 2)
    np.testing.assert_allclose(np.exp(found[2]), 1e-6)


def test_a_channel_that_stands_still_far_away_gives_no_nan():
    """Its variance is a small difference of large numbers: below 0 for one in two."""
    for value in np.random.default_rng(0).uniform(10.0, 1000.0, 50):
        still = np.full((12, 1), value, np.float32)
        assert np.isfinite(Summary(plain(1, lag=1), 12, np.float32).of(still)).all()


def test_padding_counts_for_nothing():
    values = np.random.default_rng(1).random((1, 8, 3)).astype(np.float32)
    mask = np.arange(8)[None] < 5
    padded = summaries(plain(3, lag=1), values * mask[:, :, None], mask)
    short = summaries(plain(3, lag=1), values[:, :5], mask[:, :5])
    np.testing.assert_array_equal(padded, short)


@pytest.mark.parametrize("level", [-3.0, 0.0, 1.7, 4.0, 9.0])
def test_the_novelty_score_is_minus_the_logarithm_of_the_mixtures_density(level: float):
    (found,) = NoveltyTest(level_only()).of_window(window(level))
    mixture = 0.5 * np.exp(-0.5 * level**2) + 0.5 * np.exp(-0.5 * (level - 4.0) ** 2)
    assert found == pytest.approx(-np.log(mixture), abs=1e-5)


def test_p_counts_the_known_that_are_at_least_as_strange():
    assert p_value(KNOWN.tolist(), 0.0) == 1.0
    assert p_value(KNOWN.tolist(), 99.0) == pytest.approx(2 / 100)
    assert p_value(KNOWN.tolist(), 99.5) == pytest.approx(1 / 100)
    assert p_value(KNOWN.tolist(), float("inf")) == pytest.approx(1 / 100)


def test_at_most_the_promised_share_of_exchangeable_touch_is_rejected():
    rng = np.random.default_rng(0)
    rejected = [
        p_value(sorted(scores[:-1].tolist()), float(scores[-1])) <= 0.05
        for scores in rng.normal(size=(4000, 60))
    ]
    assert 0.03 < np.mean(rejected) <= 0.06


def test_several_labels_share_the_promise():
    """Twice the least p of two labels: either alone must be twice as rare."""
    one, two = NoveltyTest(level_only()), NoveltyTest(level_only(labels=("shape", "material")))
    assert one.p_window([96.5]) == pytest.approx(0.04)
    assert two.p_window([96.5, 1.0]) == pytest.approx(0.08)


def test_for_what_is_usual_by_every_label_p_is_one_and_no_more():
    two = NoveltyTest(level_only(labels=("shape", "material")))
    assert two.p_window([1.0, 2.0]) == two.p_contact([0.05, 0.05], 4) == 1.0


def test_a_contact_is_measured_against_contacts_of_at_most_as_many_windows():
    test = NoveltyTest(level_only())
    assert test.p_contact([9.55], 1) == pytest.approx(0.91)
    assert test.p_contact([9.55], 3) == pytest.approx(0.91)
    assert test.p_contact([9.55], 4) == pytest.approx(0.05)
    assert test.p_contact([9.55], 50) == pytest.approx(0.05)


def decision_at(level: float, usable: float = 1.0) -> Decision:
    test = NoveltyTest(level_only())
    return decide(
        np.array([0.1, 0.9], np.float32), Quality(usable), CLASSES, RecogniseConfig(),
        test.of_window(window(level)), test,
    )  # fmt: skip


def test_a_sure_answer_to_something_unlike_anything_learned_is_unknown():
    assert decision_at(4.0).label == "b"
    far = decision_at(40.0)
    assert far.label == UNKNOWN
    assert far.reason == "novel touch (p = 0.01)"
    assert far.confidence == pytest.approx(0.9)


def test_unusable_input_is_named_before_its_novelty_score_and_is_not_counted():
    bad = decision_at(40.0, usable=0.5)
    assert "missing" in bad.reason
    assert bad.novelty is None


def decision(label: str, start: float, novelty: list[float] | None) -> Decision:
    p = np.array([0.9, 0.1], np.float32)
    return Decision(label, 0.9, p, "", start, start + 0.1, novelty)


def test_a_contact_that_is_strange_on_the_whole_is_unknown_and_the_next_begins_anew():
    vote = GraspVote(CLASSES, 0.5, NoveltyTest(level_only()))
    assert vote.add(decision("a", 0.0, [1.0]))[0] == "a"
    for number in range(1, 4):
        label, confidence = vote.add(decision("a", 0.2 * number, [40.0]))
    assert label == UNKNOWN
    assert np.isnan(confidence)
    assert vote.p_known == pytest.approx(0.01)
    assert vote.add(decision("a", 9.0, [1.0]))[0] == "a"
    assert vote.p_known == pytest.approx(1.0)


def test_windows_that_could_not_be_used_leave_the_contact_as_it_is():
    vote = GraspVote(CLASSES, 0.5, NoveltyTest(level_only()))
    assert vote.add(decision("a", 0.0, [1.0]))[0] == "a"
    assert vote.add(decision(UNKNOWN, 0.2, None))[0] == "a"
    assert vote.p_known == 1.0


def test_a_contact_of_which_no_window_was_tested_is_unknown():
    vote = GraspVote(CLASSES, 0.5, NoveltyTest(level_only()))
    assert vote.add(decision("a", 0.0, None))[0] == UNKNOWN
    assert np.isnan(vote.p_known)


NO_NUMBER = [float("nan"), float("inf"), -float("inf")]


def test_nan_is_as_strange_as_can_be():
    assert p_value(KNOWN.tolist(), float("nan")) == 0.0
    test = NoveltyTest(level_only(labels=("shape", "material")))
    assert test.p_window([1.0, float("nan")]) == 0.0
    assert test.p_contact([float("nan"), 1.0], 3) == 0.0


@pytest.mark.parametrize("novelty", [None, *([value] for value in NO_NUMBER)])
def test_a_window_whose_novelty_score_is_no_number_is_unknown(novelty: list[float] | None):
    found = decide(
        np.array([0.1, 0.9], np.float32), Quality(), CLASSES, RecogniseConfig(),
        novelty, NoveltyTest(level_only()),
    )  # fmt: skip
    assert (found.label, found.reason) == (UNKNOWN, UNMEASURED)


@pytest.mark.parametrize("value", [1e25, 3e38, -3e38, np.nan, np.inf])
def test_values_too_large_for_32_bits_are_unknown(value: float):
    test = NoveltyTest(level_only())
    rows = np.full((6, 1), value, np.float32)
    rows[::2] = 0.0
    found = decide(
        np.array([0.1, 0.9], np.float32), Quality(), CLASSES, RecogniseConfig(),
        test.of_window(rows), test,
    )  # fmt: skip
    assert found.label == UNKNOWN


@pytest.mark.parametrize("novelty", NO_NUMBER)
def test_a_window_that_is_no_number_lowers_the_contacts_p_and_is_outgrown(novelty: float):
    vote = GraspVote(CLASSES, 0.5, NoveltyTest(level_only()))
    assert vote.add(decision(UNKNOWN, 0.0, [novelty]))[0] == UNKNOWN
    assert vote.p_known == 0.0
    found = [vote.add(decision("a", 0.2 * number, [1.0]))[0] for number in range(1, 10)]
    assert found[-1] == "a"
    assert vote.p_known == pytest.approx(0.91 * 9 / 10)


def test_what_is_stored_gives_what_was_stored():
    before = level_only(labels=("shape", "material"))
    after = unknown_from_json(json.loads(json.dumps(unknown_to_json(before))))
    old, new = NoveltyTest(before), NoveltyTest(after)
    for level in (-1.0, 2.0, 30.0):
        novelty = old.of_window(window(level))
        assert new.of_window(window(level)) == novelty
        assert new.p_window(novelty) == old.p_window(novelty)
        assert new.p_contact(novelty, 5) == old.p_contact(novelty, 5)
    assert new.rejected == old.rejected


def test_of_two_channels_six_figures_are_projected():
    """Level, deviation and change of each; a seventh figure belongs to no channel."""
    six = np.arange(6.0)[:, None]
    stored = level_only()
    before = replace(plain(2, lag=1), densities=(replace(stored.densities[0], projection=six),))
    after = unknown_from_json(unknown_to_json(before))
    np.testing.assert_array_equal(after.densities[0].projection, six)

    seven = replace(before.densities[0], projection=np.arange(7.0)[:, None])
    with pytest.raises(ValueError, match="projection"):
        unknown_from_json(unknown_to_json(replace(before, densities=(seven,))))


def test_a_contact_shorter_than_any_known_one_is_measured_against_the_shortest():
    stored = level_only()
    density = replace(stored.densities[0], contacts={3: KNOWN, 5: KNOWN / 10.0})
    test = NoveltyTest(replace(stored, densities=(density,)))

    assert test.p_contact([9.55], 1) == pytest.approx(0.91)


def test_a_label_for_each_novelty_score_is_needed():
    with pytest.raises(ValueError, match="zip"):
        NoveltyTest(level_only()).p_contact([1.0, 2.0], 1)


def changed(**fields: object) -> dict[str, object]:
    return json.loads(json.dumps(unknown_to_json(level_only()))) | fields


def with_density(**fields: object) -> dict[str, object]:
    stored = changed()
    stored["densities"] = [stored["densities"][0] | fields]
    return stored


@pytest.mark.parametrize("bad", [
    changed(wander=[0.0]), changed(wander=[-0.5]), changed(least=[[0.0], [1.0]]),
    changed(least=[[1.0], [-1.0]]), changed(densities=[]), changed(rejected=1.5), changed(lag=-1),
    changed(lag=10**6 + 1), with_density(contacts={}), with_density(contacts={"0": [1.0]}),
    with_density(contacts={"1": [1.0], "x": [1.0]}), with_density(contacts={"01": [1.0]}),
    with_density(centres=[], log_share=[]), with_density(log_share=[0.0]),
])  # fmt: skip
def test_a_stored_test_that_makes_no_sense_is_refused(bad: dict[str, object]):
    with pytest.raises(ValueError, match=r"\w"):
        unknown_from_json(bad)


def test_the_ends_of_the_ranges_are_read():
    found = unknown_from_json(changed(lag=10**6, rejected=1.0))

    assert (found.lag, found.rejected) == (10**6, 1.0)
    assert unknown_from_json(changed(lag=0, rejected=0.0)).lag == 0
