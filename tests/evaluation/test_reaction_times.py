"""What logs say of people: times after the alarm only, outcomes by kind, an interval over logs."""

import math

import pytest

from taxel.evaluation.cards.reaction_times import reaction_times
from taxel.recordings.trial_log import GraspTrial


def trial(alarm_s: float | None, reaction_s: float | None, outcome: str = "held") -> GraspTrial:
    return GraspTrial(
        number=1, began_s=0.0, ended_s=9.0, alarm="" if alarm_s is None else "warning",
        alarm_s=alarm_s, reaction="" if reaction_s is None else "put down",
        reaction_s=reaction_s, outcome=outcome,
    )  # fmt: skip


def test_only_a_reaction_after_its_alarm_has_a_time() -> None:
    log = [trial(1.0, 1.5), trial(2.0, 3.0), trial(3.0, 2.5), trial(4.0, None, "dropped"),
           trial(None, None), trial(None, 5.0, "")]  # fmt: skip
    found = reaction_times([log])

    assert found.times_s == (0.5, 1.0)
    assert found.median_s == pytest.approx(0.75)
    assert (found.grasps, found.warned, found.reacted, found.before) == (6, 4, 2, 1)
    assert found.outcomes["alarm, no reaction"]["dropped"] == 1
    kinds = {kind: sum(counts.values()) for kind, counts in found.outcomes.items()}
    assert kinds["alarm, then a reaction"] == found.reacted
    assert kinds["a reaction before the alarm"] == found.before
    assert found.outcomes["no alarm"] == {"held": 1, "slipped": 0, "dropped": 0, "unknown": 1}


def test_the_interval_is_over_grasps_with_few_logs_and_over_logs_with_several() -> None:
    few = reaction_times([[trial(0.0, t / 10) for t in range(1, 11)]])
    several = reaction_times([[trial(0.0, t / 10)] * 4 for t in range(1, 11)])

    assert (few.drawn, several.drawn) == ("grasp", "log")
    for found in (few, several):
        low, high = found.interval_s
        assert 0.1 <= low < found.median_s < high <= 1.0


def test_without_a_reaction_there_is_no_median_and_of_one_no_interval() -> None:
    assert math.isnan(reaction_times([[trial(1.0, None)]]).median_s)
    assert math.isnan(reaction_times([[trial(1.0, 2.0)]]).interval_s[0])
