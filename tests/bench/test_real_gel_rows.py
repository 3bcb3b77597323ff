"""Rows on real gels: alarms by trial, of those that slip and of those that hold."""

from taxel.bench.transitions.real_gels import (
    WARNINGS,
    RealTrial,
    Watched,
    judge_rows,
    real_gel_rows,
)


def trial(number: int, slips: bool, alarm: bool, largest: float) -> RealTrial:
    watched = Watched(alarm=alarm, early=False, largest=largest)
    return RealTrial(
        object=f"object {number % 5}", slips=slips, images=100 if slips else 400,
        watched=dict.fromkeys(WARNINGS, watched),
    )  # fmt: skip


def test_alarms_are_counted_apart_for_trials_that_slip_and_that_hold():
    trials = [trial(n, slips=n < 10, alarm=n % 5 == 0, largest=n / 20) for n in range(20)]
    trials[1] = trial(1, slips=True, alarm=True, largest=0.05)
    rows = judge_rows(trials)

    assert len(rows) == 3 * len(WARNINGS)
    slipped, held, ranked = rows[:3]
    assert slipped.value == 0.3
    assert slipped.note.startswith("3 of 10, 95 % ")
    assert held.value == 0.2
    assert ranked.value == 0.0
    assert ranked.note == "20 trials; that the shorter trial slips 1.000"
    assert all(row.goal == "" for row in rows)


def test_without_recordings_there_is_no_value(tmp_path):
    for data in (None, tmp_path):
        rows = real_gel_rows(data)
        assert [row.value for row in rows] == [None] * len(WARNINGS)
        assert rows[0].note == "no recordings: name their folder with --data"
