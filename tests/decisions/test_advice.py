"""What a person is to do: graver words at once, milder ones once the milder state has lasted."""

import pytest

from taxel.decisions.advice import CALM_S, Advice, Adviser, advise
from taxel.decisions.stability import Stability


@pytest.mark.parametrize(
    ("state", "raises", "at_limit", "advice"),
    [
        (Stability.STABLE, False, False, Advice.HOLD),
        (Stability.WARNING, False, False, Advice.GRIP_HARDER),
        (Stability.WARNING, True, False, Advice.HOLD_STILL),
        (Stability.WARNING, True, True, Advice.PUT_DOWN),
        (Stability.UNSTABLE, True, False, Advice.PUT_DOWN),
        (Stability.UNKNOWN, False, False, Advice.HOLD_STILL),
        (Stability.NO_GRASP, False, False, Advice.NOTHING),
    ],
)
def test_each_state_has_its_word(
    state: Stability, raises: bool, at_limit: bool, advice: Advice
) -> None:
    assert advise(state, raises=raises, at_limit=at_limit) is advice


def test_of_a_gripper_of_which_no_limit_is_known_more_force_is_awaited() -> None:
    assert advise(Stability.WARNING, raises=True) is Advice.HOLD_STILL
    assert advise(Stability.WARNING) is Advice.GRIP_HARDER


def test_a_graver_word_comes_at_once_and_a_milder_one_after_a_calm_stretch() -> None:
    adviser = Adviser()
    assert adviser.push(Advice.HOLD, 0.0).advice is Advice.HOLD
    assert adviser.push(Advice.PUT_DOWN, 1.0).advice is Advice.PUT_DOWN
    assert adviser.push(Advice.HOLD, 1.1).advice is Advice.PUT_DOWN
    assert adviser.push(Advice.HOLD, 1.1 + CALM_S - 0.01).advice is Advice.PUT_DOWN
    given = adviser.push(Advice.HOLD, 1.1 + CALM_S)

    assert (given.advice, given.since_s) == (Advice.HOLD, 1.1 + CALM_S)


def test_a_word_that_is_said_on_in_a_milder_state_gives_the_true_reason() -> None:
    """Not that the state is unknown, beside a state that is STABLE."""
    adviser = Adviser()
    adviser.push(Advice.HOLD_STILL, 0.0)

    waits = adviser.push(Advice.HOLD, 1.0)
    relapse = adviser.push(Advice.HOLD_STILL, 1.2)
    adviser.push(Advice.HOLD, 1.5)
    over = adviser.push(Advice.HOLD, 1.5 + CALM_S)

    assert (waits.advice, waits.why) == (
        Advice.HOLD_STILL, "until the present state has lasted 1.5 s",
    )  # fmt: skip
    assert (waits.since_s, relapse.since_s) == (0.0, 0.0)
    assert relapse.why == "the state of the grasp is unknown: do not go on"
    assert (over.advice, over.why) == (Advice.HOLD, "the grasp is stable")


def test_a_relapse_begins_the_calm_stretch_anew() -> None:
    adviser = Adviser()
    adviser.push(Advice.PUT_DOWN, 0.0)
    adviser.push(Advice.HOLD, 1.0)
    adviser.push(Advice.PUT_DOWN, 1.5)
    adviser.push(Advice.HOLD, 2.0)

    assert adviser.push(Advice.HOLD, 1.0 + CALM_S + 0.2).advice is Advice.PUT_DOWN
    assert adviser.push(Advice.HOLD, 2.0 + CALM_S).advice is Advice.HOLD


def test_of_what_was_heard_in_the_calm_stretch_the_gravest_is_said() -> None:
    adviser = Adviser()
    adviser.push(Advice.PUT_DOWN, 0.0)
    adviser.push(Advice.HOLD, 0.1)
    adviser.push(Advice.GRIP_HARDER, 0.2)
    adviser.push(Advice.HOLD, 0.3)

    assert adviser.push(Advice.HOLD, 0.3 + CALM_S).advice is Advice.GRIP_HARDER


def test_when_the_grasp_has_ended_there_is_nothing_to_do_at_once() -> None:
    adviser = Adviser()
    adviser.push(Advice.PUT_DOWN, 0.0)

    assert adviser.push(Advice.NOTHING, 0.1).advice is Advice.NOTHING


def test_of_a_new_grasp_nothing_is_said_yet() -> None:
    adviser = Adviser()
    adviser.push(Advice.PUT_DOWN, 0.0)
    adviser.reset(1.0)

    assert adviser.given.advice is Advice.NOTHING
    assert adviser.push(Advice.HOLD, 1.1).advice is Advice.HOLD


def test_nothing_is_said_from_the_beginning_on() -> None:
    given = Adviser().given
    assert (given.advice, given.since_s) == (Advice.NOTHING, 0.0)


def test_what_raises_and_what_is_at_its_limit_are_named() -> None:
    with pytest.raises(TypeError):
        advise(Stability.WARNING, True, False)  # type: ignore[misc]
