"""What a person may say on the page of a plan, and when."""

import pytest

from taxel.views.page.link import PlanSteps, StationLink
from taxel.views.page.plan_link import PlanLink

NOTHING = "there is no last trial to discard now"


@pytest.fixture
def board() -> PlanLink:
    return PlanLink(3, asks=True)


def test_it_is_what_the_page_needs(board: PlanLink):
    link: StationLink = board

    assert isinstance(link, PlanSteps)


@pytest.mark.parametrize("what", ["again", "discard"])
def test_what_discards_is_refused_where_there_is_nothing_to_discard(board: PlanLink, what: str):
    board.show("GET READY", waits=True)
    assert (board.step(what), board.next_step()) == (NOTHING, "")

    board.show("GET READY", waits=True, discards=True)
    assert (board.step(what), board.next_step()) == ("", what)


def test_a_second_click_on_discard_is_no_step(board: PlanLink):
    """It comes while the first is not taken yet, or at the question after it."""
    board.show("GET READY", waits=True, discards=True)
    assert [board.step("discard"), board.step("discard")] == ["", ""]
    assert board.next_step() == "discard"
    board.show("HOLD STILL")
    board.show("GET READY", waits=True)

    assert board.next_step() == ""
    assert board.step("discard") == NOTHING
    assert board.step("ready") == ""


def test_nothing_is_taken_while_no_question_is_open(board: PlanLink):
    board.show("POUR NOW")

    assert board.step("ready") == "no trial waits for that now"


def test_there_is_nothing_to_disarm(board: PlanLink):
    assert board.disarm().startswith("nothing is armed")
