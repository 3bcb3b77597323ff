"""A grasp's alarm, what the person did, what came of it: kept apart grasp by grasp, and on disk."""

from pathlib import Path

import pytest

from taxel.decisions.stability import Stability
from taxel.errors import BadTable
from taxel.live.reactions import Reactions
from taxel.recordings.trial_log import (
    COLUMNS,
    GraspTrial,
    append_trial,
    log_of,
    read_trial_log,
)


def test_the_reaction_time_runs_from_the_first_alarm_to_the_first_act() -> None:
    reactions = Reactions(10.0)
    reactions.watch(Stability.STABLE, "HOLD", 11.0)
    reactions.watch(Stability.WARNING, "GRIP HARDER", 12.0)
    reactions.watch(Stability.UNSTABLE, "PUT DOWN", 12.3)
    reactions.acknowledged(12.5)
    reactions.say("pour stopped", 12.8)
    reactions.say("put down", 14.0)
    reactions.say("slipped", 15.0)
    reactions.say("held", 15.5)
    trial = reactions.end(16.0, "gross slip")

    assert trial == GraspTrial(
        number=1, began_s=10.0, ended_s=16.0, alarm="danger", alarm_s=12.0, advice="GRIP HARDER",
        acknowledged_s=12.5, reaction="pour stopped", reaction_s=12.8, outcome="held",
        outcome_by="person",
    )  # fmt: skip
    assert trial.reaction_time_s == pytest.approx(0.8)


def test_who_acted_before_the_alarm_has_a_reaction_time_below_0() -> None:
    reactions = Reactions(0.0)
    reactions.watch(Stability.STABLE, "HOLD", 0.5)
    reactions.say("put down", 1.0)
    reactions.watch(Stability.WARNING, "GRIP HARDER", 1.5)
    trial = reactions.end(2.0)

    assert trial is not None
    assert trial.reaction_time_s == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("source", "outcome"), [("hold", "held"), ("gross slip", "slipped"), ("drop", "dropped")]
)
def test_a_sources_own_outcome_stands_where_the_person_says_nothing(
    source: str, outcome: str
) -> None:
    trial = Reactions(0.0).end(1.0, source)

    assert trial is not None
    assert (trial.outcome, trial.outcome_by) == (outcome, "source")


def test_the_last_word_about_a_grasp_is_no_alarm_of_the_next() -> None:
    reactions = Reactions(0.0)
    reactions.watch(Stability.STABLE, "HOLD", 0.5)
    reactions.watch(Stability.UNSTABLE, "PUT DOWN", 1.0)
    reactions.end(2.0, "drop")
    reactions.watch(Stability.UNSTABLE, "PUT DOWN", 2.0)
    assert reactions.trial.alarm_s is None
    reactions.watch(Stability.NO_GRASP, "", 2.1)
    reactions.watch(Stability.WARNING, "GRIP HARDER", 3.0)

    assert reactions.trial.alarm_s == 3.0


def test_a_grasp_in_which_nothing_happened_is_none_and_does_not_count() -> None:
    reactions = Reactions(0.0)
    reactions.watch(Stability.STABLE, "HOLD", 0.5)
    assert reactions.end(1.0) is None
    reactions.say("held", 1.5)
    trial = reactions.end(2.0)

    assert trial is not None
    assert (trial.number, trial.began_s) == (1, 1.0)
    assert reactions.trial.number == 2


def test_what_is_no_word_of_ours_is_refused() -> None:
    with pytest.raises(ValueError, match="needed one of pour stopped, put down"):
        Reactions(0.0).say("sneezed", 1.0)


TRIALS = [
    GraspTrial(number=1, began_s=1.0, ended_s=7.25, outcome="held", outcome_by="source"),
    GraspTrial(
        number=2, began_s=7.5, ended_s=13.0, alarm="warning", alarm_s=9.125, advice="GRIP HARDER",
        reaction="grip changed", reaction_s=10.0, acknowledged_s=None,
    ),
]  # fmt: skip


def test_a_log_gives_back_what_was_written_line_by_line(tmp_path: Path) -> None:
    path = log_of(tmp_path / "pour.mcap")
    for trial in TRIALS:
        append_trial(path, trial)

    assert path.name == "pour.trials.csv"
    assert read_trial_log(path) == TRIALS
    assert path.read_text().splitlines()[0] == ",".join(COLUMNS)


def test_a_log_that_was_written_before_is_read_and_gone_on_with(tmp_path: Path) -> None:
    """Its column of advice has another name."""
    path = tmp_path / "pour.trials.csv"
    path.write_text(",".join(COLUMNS).replace("advice", "told") + "\n")
    for trial in TRIALS:
        append_trial(path, trial)

    assert read_trial_log(path) == TRIALS


@pytest.mark.parametrize(
    ("line", "needed"),
    [
        ("1,0,1", f"{len(COLUMNS)} cells"),
        ("1,0,1,loud,,,,,,,", "alarm as one of nothing, warning, danger"),
        ("1,0,1,,soon,,,,,,", "alarm_s in seconds"),
        ("1,0,inf,,,,,,,,", "ended_s in seconds"),
        ("one,0,1,,,,,,,,", "a number, began_s and ended_s"),
    ],
)
def test_a_line_that_cannot_be_used_is_refused(tmp_path: Path, line: str, needed: str) -> None:
    path = tmp_path / "pour.trials.csv"
    path.write_text(",".join(COLUMNS) + "\n" + line + "\n")
    with pytest.raises(BadTable) as refused:
        read_trial_log(path)

    assert str(refused.value).startswith(f"needed {needed}")
