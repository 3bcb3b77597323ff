"""Order effects, what taring or cropping leaves, too few trials, and names that are spelt twice."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.evaluation.audit.audit import audit, make_case
from taxel.evaluation.audit.case import Reading
from taxel.evaluation.audit.copy_findings import shared_copies
from taxel.evaluation.audit.evidence import LabelEvidence
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.names import near, near_names
from taxel.evaluation.audit.nuisances import read_first, read_length, read_level
from taxel.evaluation.audit.order_effect import measure_order
from taxel.evaluation.audit.origins import read_origins
from taxel.evaluation.audit.sides import named_sides, table_sides
from taxel.evaluation.audit.touch_set import TouchSet, group_values
from taxel.evaluation.audit.trial_order import recorded_order

Make = dict[str, Callable[..., TouchSet]]


def sorted_out(touch: TouchSet, split: str | None = None) -> dict[str, Finding]:
    """Return the findings on order alone, each without correction."""
    sides = named_sides(touch, split, 10, 5, 0) if split else None
    found = measure_order(make_case(touch, sides, 10, 0))
    if isinstance(found, Finding):
        return {found.kind: found}
    return {
        finding.kind: finding.finding(getattr(finding, "p", 0.0) or finding.evidence.p)
        for finding in found
    }


def with_drift(touch: TouchSet) -> TouchSet:
    """Return trials whose later half answers with other channels, classes turned round by one."""
    rows = []
    rng = np.random.default_rng(0)
    for index, c in enumerate(touch.y):
        later = index >= len(touch) // 2
        values = rng.normal(0.0, 0.05, touch.rows[index].shape)
        values[10:, (c + later) % 3] += 1.0
        rows.append(values.astype(np.float32))
    return replace(touch, rows=tuple(rows))


def test_what_changes_from_earlier_to_later_trials_is_a_hazard(make_set: Make) -> None:
    """Trials of any time tell one another; the earlier ones alone do not tell the later ones."""
    found = sorted_out(with_drift(make_set["array"](trials=120)))

    assert found["order effect"].verdict == "hazard"
    assert "points that will not be reached on a new later trial" in found["order effect"].message
    assert found["drift"].verdict == "note"
    assert "--split order:KEY:70%" in found["drift"].mend


def test_no_drift_no_order_effect(make_set: Make) -> None:
    """Clean trials are told as well from earlier ones as from any."""
    found = sorted_out(make_set["array"](trials=120))

    assert found["order effect"].verdict == "clear"
    assert found["drift"].verdict == "clear"


def test_a_split_that_mixes_times_leaks_and_one_that_does_not_is_clear(make_set: Make) -> None:
    """Random windows train on later trials of a session; whole sessions held out do not."""
    touch = with_drift(make_set["array"](trials=120))

    assert sorted_out(touch, "random")["order effect"].verdict == "leak"
    assert sorted_out(touch, "group:session")["order effect"].verdict == "clear"


def numbered(touch: TouchSet) -> TouchSet:
    """Return trials that are of no session, and count up as recorded."""
    return replace(touch, trials=tuple(
        replace(t, groups={**{key: t.groups[key] for key in ("recording", "trial")},
                           "trial_number": str(i)})
        for i, t in enumerate(touch.trials)))  # fmt: skip


@pytest.mark.parametrize("share", [30, 50, 70, 90])
def test_a_split_that_tests_only_what_was_recorded_later_is_clear(
    make_set: Make, share: int
) -> None:
    """It is the remedy that the finding itself names, whatever share it trains on."""
    found = sorted_out(numbered(with_drift(make_set["array"](trials=120))),
                       f"order:trial_number:{share}%")["order effect"]  # fmt: skip

    assert found.verdict == "clear"
    assert "this split keeps them apart" in found.message


def test_earlier_trials_tested_beside_later_ones_in_training_are_a_leak(
    make_set: Make, tmp_path: Path
) -> None:
    """By a table: the first quarter tested; or trials within the first half that lie between."""
    touch = numbered(with_drift(make_set["array"](trials=120)))
    for tested in (range(30), range(15, 45)):
        lines = (f"{t.recording},{'test' if i in tested else 'train'}\n"
                 for i, t in enumerate(touch.trials))  # fmt: skip
        (tmp_path / "folds.csv").write_text("recording,side\n" + "".join(lines))
        case = make_case(touch, table_sides(touch, tmp_path / "folds.csv", 10), 10, 0)
        gap = measure_order(case)
        assert not isinstance(gap, Finding)
        assert gap[0].finding(gap[0].p).verdict == "leak"


def test_order_that_nobody_knows_is_not_checked(make_set: Make) -> None:
    """Files without numbers or times have no order."""
    touch = make_set["array"]()
    alone = tuple(
        replace(t, recording=f"{chr(97 + i // 26)}{chr(97 + i % 26)}.mcap")
        for i, t in enumerate(touch.trials)
    )
    found = measure_order(make_case(replace(touch, trials=alone), None, 10, 0))
    assert isinstance(found, Finding)
    assert found.verdict == "not checked"


def by_take(touch: TouchSet, sizes: tuple[int, ...] | None = None) -> TouchSet:
    """Return trials of no session that are counted anew in each class, of so many each."""
    places, kept = np.zeros(len(touch), int), []
    for c in range(3):
        own = np.flatnonzero(touch.y == c)
        places[own] = np.arange(len(own))
        kept.extend(own[: sizes[c]] if sizes else own)
    trials = tuple(replace(t, groups={"recording": t.recording, "trial": t.groups["trial"],
                                      "take": str(place)})
                   for t, place in zip(touch.trials, places, strict=True))  # fmt: skip
    return replace(touch, trials=trials).only(np.sort(kept))


def test_the_split_in_use_is_not_advised(make_set: Make) -> None:
    """Where it tests later trials; another is, by its group where that is what gave the order."""
    touch = by_take(with_drift(make_set["array"](trials=120)))
    dated = replace(touch, created=tuple(f"2026-11-{28 - i // 6:02d}T10:{i % 6:02d}"
                                         for i in range(len(touch))))  # fmt: skip

    assert "as with --split order:take:70%;" in sorted_out(touch, "random")["drift"].mend
    used = sorted_out(touch, "order:take:70%")["drift"]
    assert used.mend == "keep this split, which tests what was recorded later; tare if it is a " \
                        "level that drifts"  # fmt: skip
    other = sorted_out(replace(dated, trials=tuple(
        replace(t, groups={**t.groups, "take": str(i)}) for i, t in enumerate(touch.trials)
    )), "order:take:70%")  # fmt: skip
    assert "as with --split order:KEY:70%, with these numbers as a group" in other["drift"].mend
    named = replace(touch, files=({"detail trial": "1"},) * len(touch))
    assert sorted_out(named, "order:take:70%")["drift"].mend == used.mend


def test_where_numbers_differ_by_class_later_trials_of_each_are_advised(make_set: Make) -> None:
    """Of 40, 40 and 12 takes none of the third class's is among the last 30 %."""
    touch = by_take(with_drift(make_set["array"](trials=120)), (40, 40, 12))

    assert "--split order:take:70%:by-class;" in sorted_out(touch)["drift"].mend
    used = sorted_out(touch, "order:take:70%:by-class")
    assert "keep this split" in used["drift"].mend
    assert "order:" not in used["order effect"].mend


def test_what_the_split_given_tests_is_not_advised(make_set: Make) -> None:
    """Classes in blocks of an order: later trials of each class are what it tests."""
    touch = numbered(make_set["array"](trials=120))
    touch = touch.only(np.argsort(touch.y, kind="stable"))
    touch = numbered(touch)

    def order(split: str | None) -> Finding:
        case = make_case(touch, named_sides(touch, split, 10, 5, 0) if split else None, 10, 0)
        reading = next(own for own in read_origins(case) if own.kind == "order")
        return reading.finding(reading.evidence.p)

    assert order(None).mend.endswith("in mixed order, and test on what was recorded later")
    assert order("group:trial").mend.endswith("and test on what was recorded later")
    used = order("order:trial_number:70%:by-class")
    assert (used.verdict, used.mend) == ("leak", "record classes in mixed order")


def test_a_later_session_that_is_tested_is_what_was_recorded_later(make_set: Make) -> None:
    """Also where no class and session has trials on both sides."""
    touch = with_drift(make_set["array"](trials=120))
    order = np.argsort([int(t.groups["session"][1:]) for t in touch.trials], kind="stable")
    touch = touch.only(order)
    touch = replace(touch, trials=tuple(
        replace(t, groups={**t.groups, "trial_number": str(i)})
        for i, t in enumerate(touch.trials)))  # fmt: skip
    case = make_case(touch, named_sides(touch, "order:trial_number:71", 10, 5, 0), 10, 0)
    found = measure_order(case)
    assert not isinstance(found, Finding)
    drift = found[1]
    assert isinstance(drift, Reading)
    assert drift.decide(True)[2].startswith("keep this split, which tests what was recorded later")


def sorted_by_person(touch: TouchSet) -> TouchSet:
    """Return trials of one file, class by class and in each person by person, who differ."""
    rng, persons = np.random.default_rng(1), rng_levels()
    trials, rows = [], []
    for place, index in enumerate(np.argsort(touch.y, kind="stable")):
        person = place % 40 // 10
        name = f"stack-{place + 1:03d}.mcap"
        trials.append(replace(touch.trials[index], recording=name, groups={
            "recording": name, "trial": f"{name}#0", "wearer": f"p{person}"}))  # fmt: skip
        rows.append((persons[person] + rng.normal(0, 0.05, (40, 6))).astype(np.float32))
    return replace(
        touch,
        trials=tuple(trials),
        rows=tuple(rows),
        files=({"detail imported_from": "a.npz", "detail trial": "7"},) * len(rows),
    )


def rng_levels() -> np.ndarray:
    """Return a level for each of four persons and six channels."""
    return np.random.default_rng(2).normal(0.0, 1.0, (4, 6))


def test_numbers_that_an_import_gave_are_no_order_of_time(make_set: Make) -> None:
    """The finding says which numbers they are; with persons held out, it is none."""
    touch = sorted_by_person(make_set["array"](trials=120))

    found = sorted_out(touch)["drift"]
    assert found.verdict == "note"
    assert "(by their numbers in the file that they were imported from)" in found.message
    assert "need not be an order of time" in found.message
    assert "--split" not in found.mend
    assert "find out what the file is sorted by" in found.mend
    held = sorted_out(touch, "group:wearer")
    assert held["drift"].verdict == "clear"
    assert held["order effect"].verdict in ("clear", "too few")
    own = sorted_out(replace(touch, files=({},) * len(touch)))["drift"].message
    assert "last number of each file's name): something drifts" in own


@pytest.mark.slow
def test_few_trials_are_not_called_clean(make_set: Make) -> None:
    """Eight trials show no leak, and the audit says that they could not."""
    alike = make_set["array"]()
    rows = tuple(own[: 40 - i % 3] for i, own in enumerate(alike.rows))
    times = tuple(own[: 40 - i % 3] for i, own in enumerate(alike.time_s))
    touch = replace(alike, rows=rows, time_s=times)
    few = touch.only(np.flatnonzero(touch.y < 2)[:8])

    result = audit(few, "few")
    many = audit(touch, "many")

    kinds, others = (
        {finding.kind: finding.verdict for finding in found.findings} for found in (result, many)
    )
    assert kinds["length"] == "too few"
    assert "could not be decided with so few trials: " in result.verdict
    assert others["length"] == "clear"


def test_of_so_few_trials_what_reaches_much_alone_is_named_with_its_figure() -> None:
    """It cannot be decided; but "does not predict" would be false."""
    evidence = LabelEvidence(accuracy=1.0, majority=0.5, auc=1.0, p=0.4)
    reading = Reading(
        kind="length", evidence=evidence,
        decide=lambda _: ("clear", "A trial's length does not predict the label.", ""),
    )  # fmt: skip
    found = reading.finding(0.4)
    assert found.verdict == "too few"
    assert found.message == (
        "Alone it reaches 1.000 (majority 0.500), but of so few trials even that could be chance."
    )
    low = replace(reading, evidence=replace(evidence, accuracy=0.6)).finding(0.4)
    assert low.message.startswith("A trial's length does not predict the label as far as")


def test_trials_of_one_length_cannot_be_told_by_it_however_few(make_set: Make) -> None:
    touch = make_set["array"]()
    result = audit(touch.only(np.flatnonzero(touch.y < 2)[:8]), "few")
    kinds = {finding.kind: finding.verdict for finding in result.findings}

    assert kinds["length"] == "clear"
    assert kinds["place"] == "clear"


def test_what_cropping_leaves_is_said(make_set: Make) -> None:
    """Trials whose length tells their class: crops of one length, and what trees reach on them."""
    touch = make_set["array"]()
    rows = tuple(own[: 40 - 6 * c] for own, c in zip(touch.rows, touch.y, strict=True))
    times = tuple(own[: len(r)] for own, r in zip(touch.time_s, rows, strict=True))
    reading = read_length(make_case(replace(touch, rows=rows, time_s=times), None, 10, 0))
    found = reading.finding(reading.evidence.p)

    assert found.verdict == "leak"
    assert found.left is not None
    assert f"Crops of the first 28 rows of every trial leave small trees at {found.left:.3f}" \
        in found.message  # fmt: skip


def test_what_taring_leaves_is_said(make_set: Make) -> None:
    """An offset a class is taken away with the first row; drift from there on is not."""
    touch = make_set["array"]()
    rng = np.random.default_rng(0)
    contact = (np.arange(40) >= 6)[:, None]
    for slope, least, most in ((0.0, 0.0, 0.6), (0.5, 0.9, 1.0)):
        drift = slope * np.minimum(np.arange(40), 6)[:, None]
        rows = tuple(
            (5 * c + drift * c + contact * 20.0 + rng.normal(0, 0.05, (40, 6))).astype(np.float32)
            for c in touch.y
        )
        reading = read_first(make_case(replace(touch, rows=rows), None, 10, 0))
        found = reading.finding(reading.evidence.p)
        still = float(found.message.split("still predicts ")[1].split()[0])

        assert found.verdict == "leak"
        assert least <= still <= most
        assert found.mend.startswith("take each trial's first row from it (tare)") == (not slope)
        assert ("does not remove this" in found.mend) == bool(slope)


@pytest.mark.parametrize(("spoilt", "named"), [((2,), True), ((0, 1, 2, 3, 4, 5), False)])
def test_a_channel_that_counts_is_named(
    make_set: Make, spoilt: tuple[int, ...], named: bool
) -> None:
    """The one whose level is the label; an offset of all channels has no such name."""
    touch = make_set["array"]()
    rows = tuple(own.copy() for own in touch.rows)
    for own, c in zip(rows, touch.y, strict=True):
        own[:, spoilt] += 50.0 * c
    names = ("a", "b", "index", "d", "e", "f")

    reading = read_level(make_case(replace(touch, rows=rows, channels=names), None, 10, 0))
    found = reading.finding(reading.evidence.p)

    assert found.verdict == "leak"
    assert ("the channel index alone" in found.message) == named
    assert found.mend.startswith("leave index out") == named


@pytest.mark.parametrize(
    ("a", "b", "same"),
    [
        ("ceramic_mug", "Ceramic mug", True), ("ceramic_mug", "ceramicmug", True),
        ("bottle", "botle", True), ("bottle", "bottel", True), ("bottle_2", "botttle_2", True),
        ("bottle_1", "bottle_2", False), ("cup", "cap", False), ("day1", "day2", False),
        ("left", "right", False), ("glove a", "glove b", False), ("10", "10.0", False),
        ("bottle", "battles", False), ("Straße", "strasse", True),
        ("ceramic_mug", "ceramic_mugg", True), ("cup", "cupp", True), ("cup", "cups", False),
        ("-40.0", "40.0", False), ("\u22127", "7", False), ("-5 N", "5 N", False),
        ("-40.0", "-40_0", False), ("-cup", "cup", True),
        ("x+y+", "x+y-", False), ("x+y0", "x-y0", False), ("x-y+", "x-y-", False),
        ("x+y+", "X+ Y+", True),
    ],
)  # fmt: skip
def test_names_that_are_probably_one(a: str, b: str, same: bool) -> None:
    """One typing error in a word, case and underscores count as one name; numbers never do."""
    assert near(a, b) is same
    assert near(b, a) is same


def test_a_misspelt_object_is_a_hazard(make_set: Make) -> None:
    """One object in two spellings can be held out beside its twin."""
    touch = make_set["array"]()
    trials = [replace(t, groups={**t.groups, "object": "bottle" if i % 2 else "can"})
              for i, t in enumerate(touch.trials)]  # fmt: skip
    trials[1] = replace(trials[1], groups={**trials[1].groups, "object": "botlle"})
    spoilt = replace(touch, trials=tuple(trials))

    found = near_names(make_case(spoilt, None, 10, 0))
    clean = near_names(make_case(touch, None, 10, 0))

    assert (found.verdict, clean.verdict) == ("hazard", "clear")
    assert found.examples == ("group object: botlle and bottle",)
    assert group_values(spoilt)["object"] == {"botlle": 1, "bottle": 29, "can": 30}


def test_copies_with_another_label_are_said(make_set: Make) -> None:
    """A trial that was pasted over one of another class is worse than one recorded twice."""
    touch = make_set["array"](trials=12)
    case = make_case(touch, named_sides(touch, "random", 10, 3, 0), 10, 0)
    same = (0, next(b for b in range(1, 12) if touch.y[b] == touch.y[0]))
    other = (0, next(b for b in range(1, 12) if touch.y[b] != touch.y[0]))
    both = shared_copies(case, "duplicates", {same: 1.0, other: 1.0}, "hold the same rows")
    alike = shared_copies(case, "duplicates", {same: 1.0}, "hold the same rows")

    assert "1 of 2 pairs with two different labels" in both.message
    assert "different labels" not in alike.message


def test_times_of_several_recordings_are_no_order(make_set: Make) -> None:
    """Each counts from its own clock: the second trial of one is not later than all first ones."""
    touch = make_set["array"]()
    trials = tuple(
        replace(t, recording=f"{chr(97 + i // 2 % 26)}{i // 52}.mcap", start_s=10.0 * (i % 2))
        for i, t in enumerate(touch.trials)
    )
    several = replace(touch, trials=trials)
    assert recorded_order(several) is None
    in_one = tuple(replace(t, recording="a.mcap") for t in trials)
    order = recorded_order(replace(touch, trials=in_one))
    assert order is not None
    assert order.places.tolist() == [float(i % 2) for i in range(len(touch))]
