"""What `taxel live` prints of the grasps of a long day (0046)."""

from dataclasses import asdict

import pytest

from taxel.cli.live.summaries import print_station_summary, trials_line
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


def test_two_errors_of_a_recording_are_two_lines(capsys: pytest.CaptureFixture[str]) -> None:
    """They were one, with \\x0a between them."""
    print_station_summary({
        "answers": [], "alarms": {"counts": {"raised": 0, "acknowledged": 0}}, "state": "NONE",
        "trials": [], "processes": {}, "latency_ms": {}, "outputs": {},
        "recording": {"error": "needed the part.\nneeded to log 1 grasp."},
    })  # fmt: skip
    assert capsys.readouterr().out.splitlines() == ["needed the part.", "needed to log 1 grasp."]
