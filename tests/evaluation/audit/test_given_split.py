"""A split that is given: the column `split` of camera trials, audited as `taxel evaluate-trials`
takes it, and one that trains on few trials."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.recordings.audit import Audit
from taxel.errors import BadSplit
from taxel.evaluation.audit.audit import make_case
from taxel.evaluation.audit.both_sides import shared_names
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.nuisances import read_length, read_place
from taxel.evaluation.audit.sides import are_given, given_sides, table_sides
from taxel.evaluation.audit.touch_set import TouchSet

Make = dict[str, Callable[..., TouchSet]]


def with_column(touch: TouchSet, tested: Callable[[int], bool]) -> TouchSet:
    trials = [
        replace(t, groups={**t.groups, "split": "test" if tested(i) else "train"})
        for i, t in enumerate(touch.trials)
    ]
    return replace(touch, trials=tuple(trials))


def of_cups(touch: TouchSet) -> Finding:
    case = make_case(touch, given_sides(touch, 8), 8, 0)
    return next(f for f in shared_names(case) if f.kind in ("same cup", "same object"))


def test_cups_on_both_sides_are_a_leak_and_held_out_ones_are_none(make_set: Make) -> None:
    """48 trials of eight cups, each of both classes: every third trial tested, or two cups."""
    touch = make_set["camera"]()
    mixed, apart = with_column(touch, lambda i: i % 3 == 0), with_column(touch, lambda i: i % 8 < 2)

    assert (of_cups(mixed).verdict, of_cups(apart).verdict) == ("leak", "clear")
    assert "share their cup with training" in of_cups(mixed).message


def test_where_the_cup_is_the_class_it_cannot_be_held_out(make_set: Make) -> None:
    touch = with_column(make_set["camera"](), lambda i: i % 3 == 0)
    trials = [replace(t, labels={touch.target: t.groups["cup"]}) for t in touch.trials]

    assert of_cups(replace(touch, trials=tuple(trials))).verdict == "note"


def test_the_column_is_taken_unless_a_split_is_named(make_set: Make) -> None:
    """For cameras; an array's trials have no such column, and --split split asks for one."""
    cameras, array = make_set["camera"](), make_set["array"]()
    given = with_column(cameras, lambda i: i > 40)

    assert are_given(given)
    assert not are_given(cameras)
    sides = Audit(data=Path("trials.csv"))._sides(given, 0)
    assert sides is not None
    assert sides[1].name == "test trials given"
    named = Audit(data=Path("trials.csv"), split="group:cup")._sides(given, 0)
    assert named is not None
    assert named[1].name == "cup held out"
    with pytest.raises(BadSplit, match="in the column split"):
        Audit(data=Path("trials.csv"), split="split")._sides(array, 0)


@pytest.mark.parametrize("lines", ["s0,train\ns0,test", "s0,train\ns0,test\ns1,train"])
def test_a_table_may_name_a_few_sessions_and_have_trials_on_both_sides(
    make_set: Make, tmp_path: Path, lines: str
) -> None:
    """Folds of the other sessions, which have no row of the table, are left out."""
    touch, table = make_set["array"](), tmp_path / "folds.csv"
    table.write_text(f"group:session,side\n{lines}\n")

    case = make_case(touch, table_sides(touch, table, 8), 8, 0)

    assert read_place(case).finding(1.0).verdict in ("clear", "too few")
    assert {f.kind: f.verdict for f in shared_names(case)}["same session"] == "leak"


def test_what_a_split_trains_on_too_little_to_show_is_not_called_clean(
    make_set: Make, tmp_path: Path
) -> None:
    """Length gives the class away over all trials; two trials to learn from cannot show it."""
    touch = make_set["array"](trials=90)
    rows = tuple(own[: 40 - 6 * c] for own, c in zip(touch.rows, touch.y, strict=True))
    times = tuple(own[: len(r)] for own, r in zip(touch.time_s, rows, strict=True))
    touch = replace(touch, rows=rows, time_s=times)
    found = {}
    for count in (1, 20):
        learned = {int(i) for c in range(3) for i in np.flatnonzero(touch.y == c)[:count]}
        lines = (f"{t.recording},{'train' if i in learned else 'test'}\n"
                 for i, t in enumerate(touch.trials))  # fmt: skip
        (tmp_path / "folds.csv").write_text("recording,side\n" + "".join(lines))
        case = make_case(touch, table_sides(touch, tmp_path / "folds.csv", 10), 10, 0)
        reading = read_length(case)
        found[count] = reading.finding(reading.evidence.p)

    assert (found[1].verdict, found[20].verdict) == ("too few", "leak")
    assert "without the split it predicts the label (1.000, majority 0.333)" in found[1].message
    assert found[1].mend == "audit without the split, and mend what is found there"
