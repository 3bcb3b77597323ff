"""Input that cannot be trusted gives UNKNOWN with a reason, never an answer."""

import numpy as np
import pytest

from taxel.decisions.joining import Joining
from taxel.decisions.recognition import (
    UNKNOWN,
    Decision,
    FaultWatch,
    GraspVote,
    Quality,
    RecogniseConfig,
    decide,
)

CLASSES = ("a", "b")


def answer(p: list[float], usable: float = 1.0, saturated: float = 0.0) -> Decision:
    return decide(np.array(p, np.float32), Quality(usable, saturated), CLASSES, RecogniseConfig())


def test_a_clear_window_is_answered() -> None:
    found = answer([0.2, 0.8])

    assert (found.label, found.reason) == ("b", "")
    assert found.confidence == pytest.approx(0.8)


def test_a_window_of_which_nothing_is_said_is_whole() -> None:
    assert Quality() == Quality(usable=1.0, saturated=0.0, span_s=(0.0, 0.0), filled=0.0)


def test_of_several_contacts_each_ones_probabilities_add_up_to_one() -> None:
    mean = np.log([[0.2, 0.3, 0.5], [0.6, 0.2, 0.2]])
    joined = Joining().of_means(mean, np.array([1.0, 4.0]))
    np.testing.assert_allclose(joined, np.exp(mean))
    surer = Joining(power=1.0).of_means(mean, np.array([1.0, 2.0]))
    np.testing.assert_allclose(surer[1], np.array([0.36, 0.04, 0.04]) / 0.44)


@pytest.mark.parametrize(
    ("p", "usable", "saturated", "reason"),
    [
        ([np.nan, np.nan], 1.0, 0.0, "NaN"),
        ([0.1, 0.9], 0.9, 0.0, "missing"),
        ([0.1, 0.9], 1.0, 1.0, "limit"),
        ([0.49, 0.48], 1.0, 0.0, "confidence"),
    ],
)
def test_doubt_gives_unknown(p: list[float], usable: float, saturated: float, reason: str) -> None:
    found = answer(p, usable, saturated)

    assert found.label == UNKNOWN
    assert reason in found.reason


def at(label: str, p: list[float], start: float) -> Decision:
    return Decision(label, max(p), np.array(p, np.float32), "", start, start + 0.1)


def test_a_contact_is_recognised_by_all_its_windows() -> None:
    vote = GraspVote(CLASSES, gap_s=0.5)
    vote.add(at("a", [0.6, 0.4], 0.0))
    vote.add(at("b", [0.1, 0.9], 0.2))
    label, confidence = vote.add(at("a", [0.6, 0.4], 0.4))

    odds = (0.4 * 0.9 * 0.4 / (0.6 * 0.1 * 0.6)) ** (1 / 3)
    assert label == "b"
    assert confidence == pytest.approx(odds / (1 + odds))


def test_a_bundle_may_say_that_more_windows_make_a_contact_surer() -> None:
    """Four windows of 0.6, power 1 and strength 0.5: odds 1.5² in place of 1.5."""
    plain, sure = GraspVote(CLASSES, 0.5), GraspVote(CLASSES, 0.5, joining=Joining(1.0, 0.5))
    for number in range(4):
        decision = at("a", [0.6, 0.4], 0.1 * number)
        label, confidence = plain.add(decision)
        surer_label, surer = sure.add(decision)

    assert (label, surer_label) == ("a", "a")
    assert confidence == pytest.approx(0.6)
    assert surer == pytest.approx(1.5**2 / (1 + 1.5**2))
    assert sure.emptied().add(at("a", [0.6, 0.4], 0.0))[1] == pytest.approx(
        1.5**0.5 / (1 + 1.5**0.5)
    )


def test_a_new_contact_starts_anew() -> None:
    vote = GraspVote(CLASSES, gap_s=0.5)
    vote.add(at("b", [0.01, 0.99], 0.0))
    label, _ = vote.add(at("a", [0.6, 0.4], 5.0))

    assert label == "a"
    assert vote.windows == 1


def test_unknown_windows_do_not_vote() -> None:
    vote = GraspVote(CLASSES, gap_s=0.5)
    label, _ = vote.add(at(UNKNOWN, [0.0, 1.0], 0.0))

    assert label == UNKNOWN
    assert vote.add(at("a", [0.6, 0.4], 0.1))[0] == "a"


def faulty(start: float, end: float, usable: float = 0.5) -> Decision:
    quality = Quality(usable=usable, span_s=(start, end))
    return decide(np.array([0.9, 0.1], np.float32), quality, CLASSES, RecogniseConfig())


def test_a_contact_of_which_nothing_is_measured_for_longer_than_a_pause_is_over() -> None:
    """A sensor that is gone is not answered for by what it measured before."""
    vote = GraspVote(CLASSES, gap_s=0.5)
    vote.add(at("a", [0.9, 0.1], 0.0))  # ends at 0.1 s
    assert vote.add(faulty(0.2, 0.4))[0] == "a"
    assert vote.add(faulty(0.4, 0.6))[0] == "a"
    assert vote.add(faulty(0.5, 0.7))[0] == UNKNOWN
    assert vote.windows == 0
    assert vote.add(at("b", [0.4, 0.6], 0.8)) == ("b", pytest.approx(0.6))


def test_a_single_missing_row_ends_no_contact_however_long_the_windows() -> None:
    """It makes all windows of 1 s unusable that hold it, and no window that does not."""
    vote = GraspVote(CLASSES, gap_s=0.2)
    for start in (0.0, 0.1, 0.2):
        vote.add(Decision("a", 0.9, np.array([0.9, 0.1], np.float32), "", start, start + 1.0))
    for number in range(10):
        assert vote.add(faulty(0.3 + 0.1 * number, 1.3 + 0.1 * number, 0.99))[0] == "a"
    assert vote.add(faulty(1.4, 2.4, 0.99))[0] == UNKNOWN  # it shares no row with the first


def test_windows_without_any_value_end_a_contact_after_a_pause_at_once() -> None:
    vote = GraspVote(CLASSES, gap_s=0.2)
    vote.add(Decision("a", 0.9, np.array([0.9, 0.1], np.float32), "", 0.0, 1.0))
    assert vote.add(faulty(0.1, 1.1, 0.9))[0] == "a"
    assert vote.add(faulty(0.5, 1.19, 0.0))[0] == "a"
    assert vote.add(faulty(0.6, 1.3, 0.0))[0] == UNKNOWN
    assert vote.add(faulty(0.7, 1.4, 0.9))[0] == UNKNOWN  # still


def test_a_window_of_which_nothing_is_said_is_not_empty() -> None:
    assert not at("a", [0.9, 0.1], 0.0).empty
    assert (faulty(0.0, 0.1, 0.0).empty, faulty(0.0, 0.1, 0.01).empty) == (True, False)


def test_where_a_mark_says_what_belongs_together_no_pause_parts_it() -> None:
    vote = GraspVote(CLASSES, gap_s=0.5).emptied()
    vote.add(at("a", [0.9, 0.1], 0.0))
    vote.add(faulty(5.0, 9.0, 0.0))
    assert vote.add(at("a", [0.9, 0.1], 20.0))[0] == "a"
    assert vote.windows == 2


def test_short_faults_in_a_row_of_good_windows_end_no_contact() -> None:
    vote = GraspVote(CLASSES, gap_s=0.5)
    for start in (0.0, 0.4, 0.8):
        vote.add(at("a", [0.9, 0.1], start))
        vote.add(faulty(start + 0.1, start + 0.3))
    assert vote.windows == 3


def test_a_doubtful_window_was_measured_all_the_same() -> None:
    """Low confidence keeps a contact alive: touch goes on, only its class is unclear."""
    vote = GraspVote(CLASSES, gap_s=0.5)
    vote.add(at("a", [0.9, 0.1], 0.0))
    for start in (0.3, 0.7, 1.1):
        label, _ = vote.add(at(UNKNOWN, [0.45, 0.4], start))
    assert label == "a"


@pytest.mark.parametrize(
    ("p", "usable", "saturated", "measured"),
    [([0.2, 0.8], 1.0, 0.0, True), ([0.45, 0.4], 1.0, 0.0, True), ([0.2, 0.8], 0.9, 0.0, False),
     ([0.2, 0.8], 1.0, 1.0, False), ([np.nan, np.nan], 1.0, 0.0, False)],
)  # fmt: skip
def test_usable_is_what_was_measured(
    p: list[float], usable: float, saturated: float, measured: bool
) -> None:
    assert answer(p, usable, saturated).usable is measured


def test_without_a_gate_the_answer_follows_what_is_held() -> None:
    """Of the latest four windows, however many came before."""
    vote, endless = (GraspVote(CLASSES, 0.5, most=most) for most in (4, None))
    for number in range(1000):
        decision = at("a", [0.9, 0.1], 0.1 * number)
        vote.add(decision)
        endless.add(decision)
    for number in range(1000, 1003):
        decision = at("b", [0.1, 0.9], 0.1 * number)
        found, stays = vote.add(decision), endless.add(decision)
    assert (vote.windows, endless.windows) == (4, 1003)
    assert found == ("b", pytest.approx(0.75))  # odds (1/9 · 9 · 9 · 9)^(1/4) = 3
    assert stays[0] == "a"


def test_the_limits_are_those_of_decision_0010() -> None:
    config = RecogniseConfig()

    assert (config.least_confidence, config.least_usable, config.most_saturated) == (
        0.5, 1.0, 0.999,
    )  # fmt: skip


def test_another_limit_may_be_asked_for() -> None:
    config = RecogniseConfig(least_confidence=0.9)
    assert decide(np.array([0.2, 0.8], np.float32), Quality(), CLASSES, config).label == UNKNOWN


@pytest.mark.parametrize(("p", "saturated"), [([0.5, 0.5], 0.0), ([0.2, 0.8], 0.999)])
def test_a_limit_itself_is_still_fine(p: list[float], saturated: float) -> None:
    assert answer(p, saturated=saturated).reason == ""


def test_the_share_that_is_missing_is_reported() -> None:
    assert answer([0.2, 0.8], usable=0.75).reason == "25% of the values are missing, stale or NaN"


def test_values_that_were_filled_in_count_as_usable_and_are_reported() -> None:
    quality = Quality(usable=0.75, span_s=(3.0, 4.0), filled=0.25)
    found = decide(np.array([0.2, 0.8], np.float32), quality, CLASSES, RecogniseConfig())

    assert (found.label, found.filled, found.start_s, found.end_s) == ("b", 0.25, 3.0, 4.0)
    assert answer([0.2, 0.8]).filled == 0.0
    assert at("a", [0.6, 0.4], 0.0).filled == 0.0


@pytest.mark.parametrize(("start", "windows"), [(0.5, 2), (0.5001, 1)])
def test_a_pause_of_just_the_gap_is_within_a_contact(start: float, windows: int) -> None:
    """The first window ends at 0.1 s; 0.4 s is the longest pause within a contact."""
    vote = GraspVote(CLASSES, gap_s=0.5 - 0.1)
    vote.add(at("a", [0.6, 0.4], 0.0))
    vote.add(at("a", [0.6, 0.4], start))

    assert vote.windows == windows


def test_an_emptied_vote_asks_the_same_of_another_contact() -> None:
    vote = GraspVote(CLASSES, gap_s=0.5)
    vote.add(at("a", [0.6, 0.4], 0.0))
    other = vote.emptied()

    assert (other.windows, other.classes, vote.windows) == (0, CLASSES, 1)
    assert other.add(at("b", [0.4, 0.6], 0.0)) == ("b", pytest.approx(0.6))


def test_a_fault_counts_from_its_first_window_where_nothing_was_usable_before() -> None:
    watch = FaultWatch(0.5)
    found = [watch.look(faulty(start, start + 0.1, 0.0)) for start in (0.0, 0.2, 0.4, 0.6)]
    assert found == [False, False, False, True]
    assert watch.first is not None
    assert watch.first.start_s == 0.0
    assert not watch.look(at("a", [0.9, 0.1], 0.8))
    assert watch.first is None
