"""Lines beside results: columns as wide as a terminal allows, and what was not tried by name."""

import io
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from rich.console import Console

from taxel.evaluation.baselines import TRIVIAL
from taxel.evaluation.crossval import Pooled
from taxel.evaluation.nested import Nested, TrialScores
from taxel.evaluation.run_scores import GroupInterval
from taxel.labels.trials import Trial
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.choice import Choice, Standing
from taxel.training.predictions import Predictions
from taxel.views.tables.expert import leaderboard, nested_table
from taxel.views.tables.results import bracketed, confusion_table, few, with_interval

ONE_SESSION = "only one session was tested: the interval says nothing about other sessions"


def printed(what: object, width: int) -> str:
    console = Console(file=io.StringIO(), width=width, record=True)
    console.print(what)
    return console.export_text()


def test_names_of_classes_are_cut_only_as_far_as_the_line_is_short():
    names = [f"{word} cup" for word in ("aluminium", "porcelain", "stoneware")]
    counts = [[10, 0, 0], [0, 10, 0], [0, 0, 10]]

    whole, cut = (
        next(line for line in printed(confusion_table(names, counts, width), width).splitlines()
             if "predicted" in line)
        for width in (80, 50)
    )  # fmt: skip

    assert all(name in whole for name in names)
    assert all(name[:6] in cut and name not in cut for name in names)
    many = [f"class {n:02d} of twenty" for n in range(20)]
    table = confusion_table(many, [[0] * 20 for _ in many], 80)
    assert max(len(str(column.header)) for column in table.columns[1:]) == 4


def test_what_was_not_tried_is_named():
    """A few kinds in the line, in the order in which they would have been tried."""
    tried = (Candidate("network", "touchnet", ""), Candidate("perceptron", "perceptron", "all", 3),
             Candidate("perceptron", "perceptron", "tared", 3),
             Candidate("trees", "extra-trees", "tared", 2),
             Candidate("linear", "logistic", "tared", 0.03),
             Candidate("trees", "random-forest", "all", 2))  # fmt: skip
    left_out = tuple(f"{own.name} · 80 rows" for own in tried)
    choice = cast(Choice, SimpleNamespace(
        target="y", folds=5, held="session", leaderboard=(), why="the best", loss=0.1,
        accuracy=0.9, left_out=left_out, behind=(), slow=("quantiles", "shape"),
    ))  # fmt: skip

    text = " ".join(printed(leaderboard(choice), 200).split())

    assert ("6 not tried, because the time was up: TouchNet, perceptrons 3 on all features, "
            "extra-trees 2 on tared features, logistic regression 0.03 on tared features …; "
            "expert.json lists all") in text  # fmt: skip
    assert "window would take longer than --max-us: quantiles, shape; a larger --max-us" in text
    assert "not tried" not in printed(leaderboard(choice, repeated=True), 200)
    assert "1 of N" not in text


def test_a_leaderboard_says_what_a_try_on_a_part_of_the_windows_is():
    rows = tuple(
        Standing(name="extra-trees 2", windows=windows, loss=0.5, accuracy=0.8, seconds=1.0)
        for windows in ("400 rows, 1 of 5", "400 rows")
    )
    choice = cast(Choice, SimpleNamespace(
        target="y", folds=5, held="session", leaderboard=rows, why="the best", loss=0.1,
        accuracy=0.9, left_out=(), behind=(), slow=(),
    ))  # fmt: skip

    assert "“1 of N”: tried on one in N of the stretches" in printed(leaderboard(choice), 200)
    assert "on 5 inner folds, session held out" in printed(leaderboard(choice), 200)
    choice.folds = 1  # type: ignore[misc]  # a namespace here
    assert "on 1 inner fold, session held out" in printed(leaderboard(choice), 200)


def judged(confidence: float, windows_a_trial: int = 1, shared: bool = False) -> Predictions:
    """Return predictions of four trials of equal length in two sessions, two folds.

    Args:
        confidence: The largest of three probabilities in each window.
        windows_a_trial: How many windows a trial has.
        shared: Whether each fold learned from trials of the tested session, too.
    """
    trials = tuple(
        Trial(recording=f"r{i}", start_s=0.0, end_s=2.0, labels={"k": "ab"[i % 2]},
              groups={"recording": f"r{i}", "trial": f"r{i}", "session": f"s{i // 2}"})
        for i in range(4)
    )  # fmt: skip
    trial = np.repeat(np.arange(4), windows_a_trial)
    return Predictions(
        split="session held out", classes=("a", "b", "c"), trials=trials, folds=("s0", "s1"),
        trained=np.array([[0, shared, 1, 1], [1, 1, 0, shared]], np.intp), trial=trial,
        start_s=np.tile(np.arange(windows_a_trial) / 2.0, 4), fold=trial // 2, y=trial % 2,
        probabilities=np.tile([confidence, *[(1.0 - confidence) / 2] * 2], (len(trial), 1)),
    )  # fmt: skip


def shown(
    predictions: Predictions, folds: int = 2, interval: tuple[float, float, int] = (0.3, 0.5, 2)
) -> str:
    """Return the lines of a nested score."""
    scored = SimpleNamespace(
        scores=SimpleNamespace(accuracy=0.4, loss=0.7), calibration_error=0.1, group="session",
        intervals={"session": GroupInterval(*interval)}, lone=None,
    )  # fmt: skip
    nested = SimpleNamespace(
        scores=scored, by_trial=TrialScores(accuracy=0.4, loss=0.7, trials=4), fixed=False,
        split="session held out", choices=(None,) * folds, predictions=predictions, bars={},
        trivial=dict.fromkeys(("majority", *TRIVIAL), 0.2), warning=None,
    )  # fmt: skip
    return printed(nested_table(cast(Nested, nested)), 200)


@pytest.mark.parametrize(
    ("interval", "narrow"), [((0.3, 0.5, 2), True), ((0.3, 0.5, 6), False), ((0.4, 0.4, 2), False)]
)
def test_train_says_that_an_interval_over_few_sessions_is_too_narrow(
    interval: tuple[float, float, int], narrow: bool
):
    """As evaluate does; where all sessions are alike, there is no interval."""
    line = "2 sessions: the interval is about their lowest and highest; record more"
    assert (line in shown(judged(0.8), interval=interval)) == narrow


def test_train_says_which_share_of_windows_live_would_name():
    unsure, sure = judged(0.45), judged(0.8)
    first_two = np.concatenate([sure.probabilities[:2], unsure.probabilities[2:]])
    silent, half = shown(unsure), shown(replace(sure, probabilities=first_two))

    assert "warning: live would answer UNKNOWN to all of these test windows, as its" in silent
    assert "confidence is below 0.5" in silent
    assert "\nlive would name 50.0 % of these test windows, 50.0 % of them rightly;" in half
    assert "live would name" not in shown(judged(0.8))


def test_windows_that_stand_at_the_limit_are_not_named_live():
    """Live answers UNKNOWN to them, however sure the model is."""
    sure = judged(0.8)
    first, every = (replace(sure, at_limit=np.arange(4) < count) for count in (1, 4))
    both = replace(judged(0.45), at_limit=np.arange(4) < 1)

    assert "\nlive would name 75.0 % of these test windows, 33.3 % of them rightly;" in shown(first)
    assert "as a channel stands at the converter's limit in all rows of 1 window;" in shown(first)
    assert "confidence is below" not in shown(first)
    assert "warning: live would answer UNKNOWN to all of these test windows, as a" in shown(every)
    assert "confidence is below 0.5 (taxel live --least-confidence), or a channel" in shown(both)


def test_baselines_that_have_nothing_to_go_by_are_not_in_the_table():
    line = "carry no information here: place in the trial, length of the trial, session"
    assert line in shown(judged(0.8))
    assert "channel means" in shown(judged(0.8))
    text = shown(judged(0.8, windows_a_trial=3, shared=True))
    assert "nothing to go by" not in text
    assert all(name in text for name in TRIVIAL)


def test_an_interval_without_width_is_no_certainty():
    """Four sessions of one accuracy, or one session: neither shows how far others may differ."""
    assert "95 % CI over 4 sessions: 0.3000 … 0.5000" in shown(judged(0.8), interval=(0.3, 0.5, 4))
    alike = shown(judged(0.8), interval=(1.0, 1.0, 4))
    assert "no 95 % CI: 4 sessions, all alike; others may differ" in alike
    alone = shown(judged(0.8), interval=(float("nan"), float("nan"), 1))
    assert "no 95 % CI: 1 session only" in alone
    assert "nan" not in alone
    assert "1.0000 … 1.0000" not in alike


def test_tables_print_all_alike_in_an_interval_s_place_and_what_that_means():
    assert bracketed("1.0000", (1.0, 1.0), ".3f") == "1.0000 [all alike]"
    assert bracketed("0.9000", (0.8, 1.0), ".3f") == "0.9000 [0.800, 1.000]"
    own, bar = (
        cast(Pooled, SimpleNamespace(
            scores=SimpleNamespace(accuracy=high), interval=(low, high), interval_group="session",
            interval_groups=4, lone=None,
        ))
        for low, high in ((0.7, 0.9), (1.0, 1.0))
    )  # fmt: skip
    meaning = "all alike: no interval, as each session gave the same; others may differ"
    assert with_interval(bar) == "1.0000 [all alike]"
    narrow = "4 sessions: the interval is about their lowest and highest; record more"
    assert [str(line) for line in few(own, bar)] == [meaning, narrow]
    assert [str(line) for line in few(own)] == [narrow]
    assert [str(line) for line in few(bar)] == [meaning]


def test_one_outer_fold_is_no_folds():
    assert "nested: chosen on the training part alone" in shown(judged(0.8), folds=1)
    assert "nested: each of 2 folds chose" in shown(judged(0.8))


def test_train_says_that_one_session_was_tested():
    """Beside an interval over its files; not beside one over sessions."""
    scored = SimpleNamespace(
        scores=SimpleNamespace(accuracy=0.9, loss=0.3), calibration_error=0.1, group="file",
        intervals={"file": GroupInterval(0.8, 0.95, 66)}, lone="session",
    )  # fmt: skip
    nested = SimpleNamespace(
        scores=scored, by_trial=TrialScores(accuracy=0.9, loss=0.3, trials=66), fixed=False,
        split="folds.csv, session held out", choices=(None,), predictions=judged(0.9), bars={},
        trivial={}, warning=None,
    )  # fmt: skip

    assert ONE_SESSION in printed(nested_table(cast(Nested, nested)), 120)
    scored.lone = None
    assert ONE_SESSION not in printed(nested_table(cast(Nested, nested)), 120)


def test_all_right_is_not_clear_of_a_baseline_that_misses_hardly_one() -> None:
    """49 of 49 right: the interval over files has no width, and 48 of 49 is within chance of it."""

    def warned(baseline: float) -> str:
        scores = SimpleNamespace(scores=SimpleNamespace(accuracy=1.0), group="file",
                                 intervals={"file": GroupInterval(1.0, 1.0, 49)})  # fmt: skip
        nested = SimpleNamespace(
            scores=scores, trivial={"channel means": baseline},
            by_trial=TrialScores(accuracy=1.0, loss=0.1, trials=49),
        )  # fmt: skip
        return cast(property, Nested.warning).fget(nested) or ""  # type: ignore[misc]

    assert "“channel means” (98.0 %), but its interval is not" in warned(48 / 49)
    assert warned(0.9) == ""
