"""What a session counts as right."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from taxel.decisions.recognition import UNKNOWN, Decision, GraspVote
from taxel.live.recogniser import Answer
from taxel.live.session import MANY_TOUCHES, Tally
from taxel.signals import Mark
from taxel.windows.level_follow import LevelNow
from taxel.windows.windower import Windows

CLASSES = ("ball", "block")


def answered(label: str, start_s: float = 0.0, ball: float = 0.5) -> Answer:
    window = Windows(
        np.zeros((1, 2, 1), np.float32), np.ones((1, 2), bool), np.ones(1, np.float32),
        np.zeros(1, np.float32), np.zeros(1), np.ones(1),
    )  # fmt: skip
    probabilities = np.array([ball, 1 - ball], np.float32)
    decision = Decision(label, 0.9, probabilities, "", start_s, start_s + 1.0)
    return Answer(decision, window, 1e-4)


@pytest.mark.parametrize(
    ("label", "truth", "right"),
    [("ball", "ball", 1), ("ball", "block", 0), (UNKNOWN, "ball", 0), (UNKNOWN, "prism", 1),
     ("ball", "prism", 0)],
)  # fmt: skip
def test_unknown_is_the_right_answer_to_what_was_never_learned(label: str, truth: str, right: int):
    tally = Tally("shape", GraspVote(CLASSES, 0.8))
    tally.add(answered(label))
    tally.compare(Mark(start_s=0.0, end_s=2.0, labels={"shape": truth}))
    assert (tally.marked, tally.right) == (1, right)


def test_a_padded_window_is_counted_although_its_mark_came_first():
    """It is cut when the touch is long over, or when the source ends."""
    first, second = (
        Mark(start_s=start, end_s=start + 2.0, labels={"shape": truth})
        for start, truth in ((0.0, "ball"), (-3.0, "block"))
    )
    tally = Tally("shape", GraspVote(CLASSES, 0.8), late=True)
    tally.compare(second)
    tally.compare(first)
    tally.add(answered("ball"))
    tally.settle()
    assert (tally.marked, tally.right, tally.grasps, tally.grasps_right) == (1, 1, 1, 1)


def test_a_marked_grasp_without_a_whole_window_is_counted_as_undecided():
    tally = Tally("shape", GraspVote(CLASSES, 0.8))
    tally.add(answered("ball"))
    tally.compare(Mark(start_s=0.0, end_s=2.0, labels={"shape": "ball"}))
    tally.compare(Mark(start_s=3.0, end_s=3.5, labels={"shape": "ball"}))
    assert (tally.grasps, tally.grasps_without) == (1, 1)
    assert tally.summary()["grasps_without"] == 1


def test_two_labels_joined_are_compared_as_one():
    tally = Tally("shape+material", GraspVote(("ball glass", "block wood"), 0.8))
    tally.add(answered("ball glass"))
    tally.compare(Mark(start_s=0.0, end_s=2.0, labels={"shape": "ball", "material": "glass"}))
    assert (tally.marked, tally.right) == (1, 1)


def test_what_was_grasped_before_has_no_vote_where_no_pause_parts_the_grasps():
    """Long recordings have labelled stretches side by side, without a contact's end."""
    tally = Tally("shape", GraspVote(CLASSES, 0.8))
    for start_s in range(4):
        tally.add(answered("ball", float(start_s), ball=0.99))
    tally.add(answered("block", 4.0, ball=0.2))
    tally.compare(Mark(start_s=0.0, end_s=4.0, labels={"shape": "ball"}))
    tally.compare(Mark(start_s=4.0, end_s=5.0, labels={"shape": "block"}))
    tally.settle()
    assert (tally.grasps, tally.grasps_right) == (2, 2)
    assert tally.grasp_answer[0] == "ball"  # what is shown knows no marks


@pytest.mark.parametrize(("next_s", "own"), [(4.0, 3), (4.5, 4), (None, 4)])
def test_a_row_where_two_marks_meet_is_the_later_ones_as_in_a_data_set(
    next_s: float | None, own: int
) -> None:
    """The last of four windows ends with its mark; that another begins there is known only when
    that is over."""
    tally = Tally("shape", GraspVote(CLASSES, 0.8))
    for start_s in range(4):
        tally.add(answered("ball", float(start_s), ball=0.99))
    tally.compare(Mark(start_s=0.0, end_s=4.0, labels={"shape": "ball"}))
    tally.add(answered("block", 5.0, ball=0.01))
    if next_s is not None:
        tally.compare(Mark(start_s=next_s, end_s=7.0, labels={"shape": "block"}))
    tally.settle()

    grasps = 1 if next_s is None else 2
    assert (tally.marked, tally.grasps, tally.grasps_right) == (own + grasps - 1, grasps, grasps)


def test_a_session_of_one_answer_is_warned_of_where_levels_follow() -> None:
    def warned(hard: int, touches: int) -> str:
        answers = Counter(hard=hard, soft=10 - hard)
        tally = Tally("kind", GraspVote(("hard", "soft"), 1.0), windows=10, answers=answers)
        tally.level = LevelNow(touches=touches, least=0.5, most=2.0)
        return str(tally.summary()["level"]["warning"])

    assert warned(9, MANY_TOUCHES).startswith("90% of the answers are hard")
    assert warned(8, MANY_TOUCHES) == warned(9, MANY_TOUCHES - 1) == ""
