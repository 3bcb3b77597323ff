"""What `taxel live` prints of the grasps of a long day (0046)."""

from dataclasses import asdict

from taxel.cli.live.summaries import trials_line
from taxel.recordings.trial_log import GraspTrial


def line(first: int, last: int) -> str:
    trials = [
        GraspTrial(number=number, began_s=0.0, ended_s=1.0, outcome="held")
        for number in range(first, last + 1)
    ]
    return trials_line([asdict(trial) for trial in trials])


def test_where_earlier_grasps_are_not_kept_the_line_says_of_how_many_these_are_the_last() -> None:
    """Before, a day of 10,800 grasps was counted as 10,000."""
    assert line(1, 3).startswith("3 grasps: 0 with an alarm")
    assert line(801, 810).startswith("the last 10 of 810 grasps: 0 with an alarm")
