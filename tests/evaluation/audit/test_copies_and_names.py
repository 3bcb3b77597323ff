"""Copies on one side, windows cut with overlap, names for one fact, and first rows in doubt."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from taxel.evaluation.audit.audit import audit, make_case
from taxel.evaluation.audit.copies import row_numbers, same_rows
from taxel.evaluation.audit.copy_findings import joining_group, shared_copies
from taxel.evaluation.audit.cut_windows import beside_windows, cut_windows
from taxel.evaluation.audit.finding import Audit, Finding
from taxel.evaluation.audit.nuisances import read_first, stands_still_first
from taxel.evaluation.audit.origins import read_origins
from taxel.evaluation.audit.sides import named_sides
from taxel.evaluation.audit.touch_set import TouchSet, usual_steps
from taxel.plain_text import several

Make = dict[str, Callable[..., TouchSet]]
KINDS = ("duplicates", "near-duplicates", "augmented copies")


def copies(touch: TouchSet, split: str | None, pairs: dict[tuple[int, int], float]) -> Finding:
    """Return what is said of such pairs under a split, or without one."""
    steps = usual_steps(touch)
    sides = None if split is None else named_sides(touch, split, steps, 5, 0)
    return shared_copies(make_case(touch, sides, steps, 0), "duplicates", pairs, "are alike")


def streams(make: Callable[..., TouchSet], length: int = 20, step: int = 1) -> TouchSet:
    """Return six streams of noise cut into ten windows each, which overlap."""
    touch, rng = make(trials=60), np.random.default_rng(4)
    whole = rng.normal(size=(6, length + 10 * step, 6)).astype(np.float32)
    trials = [
        replace(
            trial, labels={"shape": f"c{i // 10 % 2}"},
            groups={**trial.groups, "session": f"s{i // 30}", "stream": f"t{i // 10}"},
        )
        for i, trial in enumerate(touch.trials)
    ]  # fmt: skip
    rows = tuple(whole[i // 10, i % 10 * step : i % 10 * step + length] for i in range(60))
    return replace(touch, trials=tuple(trials), rows=rows,
                   time_s=(np.arange(length) / 20.0,) * 60)  # fmt: skip


def test_copies_on_one_side_of_a_split_are_a_note(make_set: Make) -> None:
    """Trials 0 and 5 are of one session, which is held out; 0 and 1 are of two."""
    touch = make_set["array"]()

    inside = copies(touch, "group:session", {(0, 5): 1.0})
    across = copies(touch, "group:session", {(0, 1): 1.0})

    assert inside.verdict == "note"
    assert inside.alone is None
    assert "nothing of a test trial is in its training part" in inside.message
    assert "2 tested trials count more than once" in inside.message
    assert across.verdict == "leak"
    assert "2 of 60 tested trials" in across.message
    assert across.alone is not None
    assert across.majority is not None
    # both are of class 0, so that a look-up can only gain on the commonest answer
    assert across.alone >= across.majority


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_copy_is_a_leak_across_and_a_note_within(make_set: Make, kind: str) -> None:
    """The same rows, scaled, or run backwards: in one session that is held out, or in two."""
    touch = make_set["array"]()
    first = touch.rows[0]
    changed = {"duplicates": first, "near-duplicates": 1.3 * first + 2,
               "augmented copies": first[::-1]}[kind]  # fmt: skip
    for other, verdict in ((5, "note"), (1, "leak")):
        rows = list(touch.rows)
        rows[other] = np.ascontiguousarray(changed, np.float32)
        spoilt = replace(touch, rows=tuple(rows))
        split = named_sides(spoilt, "group:session", usual_steps(spoilt), 5, 0)
        found = {finding.kind: finding for finding in audit(spoilt, "x", split).findings}
        assert found[kind].verdict == verdict


def test_without_a_split_copies_wait_where_a_group_keeps_them_together(make_set: Make) -> None:
    """In one session: hold it out. In two sessions: no group that is named mends it."""
    touch = make_set["array"]()

    assert joining_group(touch, {(0, 5): 1.0}) == "session"
    together = copies(touch, None, {(0, 5): 1.0})
    assert together.verdict == "hazard"
    assert "whole sessions" in together.mend
    assert joining_group(touch, {(0, 1): 1.0}) is None
    assert copies(touch, None, {(0, 1): 1.0}).verdict == "leak"


@pytest.mark.parametrize("step", [1, 5])
def test_windows_of_a_stream_are_told_from_copies(make_set: Make, step: int) -> None:
    """None is to be dropped: the session that joins them is to be held out."""
    touch = streams(make_set["array"], step=step)

    found = {finding.kind: finding for finding in audit(touch, "x").findings}

    assert found["cut with overlap"].verdict == "hazard"
    assert found["cut with overlap"].mend == "hold out whole sessions"
    assert found["duplicates"].verdict == "clear"
    assert found["near-duplicates"].verdict == "clear"


def test_windows_on_both_sides_are_a_leak_and_held_out_streams_none(make_set: Make) -> None:
    """Whole streams held out keep them apart; single trials do not."""
    touch = streams(make_set["array"])
    verdicts = {}
    for key in ("stream", "recording"):
        split = named_sides(touch, f"group:{key}", usual_steps(touch), 5, 0)
        found = {finding.kind: finding for finding in audit(touch, "x", split).findings}
        verdicts[key] = found["cut with overlap"].verdict

    assert verdicts == {"stream": "note", "recording": "leak"}


def test_a_copy_of_a_window_is_still_a_copy(make_set: Make) -> None:
    """Equal trials are to be dropped though others overlap with both."""
    touch = streams(make_set["array"], step=5)
    rows = (*touch.rows[:-1], touch.rows[0])
    spoilt = replace(touch, rows=rows)

    same, cut = same_rows(spoilt), cut_windows(spoilt)

    assert same is not None
    assert list(beside_windows(spoilt, same, cut)) == [(0, 59)]


def test_copies_that_start_elsewhere_and_rest_are_no_windows(make_set: Make) -> None:
    """A copy ends with its original; rest before touch is alike in all trials."""
    touch = make_set["array"]()
    crop = replace(touch, rows=(*touch.rows[:-1], touch.rows[0][5:]))
    rest = tuple(np.concatenate([np.zeros((15, 6), np.float32), own, np.zeros((15, 6), np.float32)])
                 for own in touch.rows)  # fmt: skip

    assert not cut_windows(touch)
    assert not cut_windows(crop)
    assert not cut_windows(replace(touch, rows=rest))


@pytest.mark.parametrize("seed", range(3))
def test_coarse_values_that_go_on_by_chance_are_no_windows(make_set: Make, seed: int) -> None:
    """Two steps on one channel: six rows meet by chance."""
    rng = np.random.default_rng(seed)
    rows = tuple(rng.integers(0, 2, (14, 1)).astype(np.float32) for _ in range(60))
    touch = replace(make_set["array"](), views=("array",), rows=rows)

    assert not cut_windows(touch)


def test_rows_have_equal_numbers_where_they_are_equal() -> None:
    """Whatever trial they stand in, and however many rows are numbered at once."""
    rng = np.random.default_rng(0)
    trials = [rng.normal(size=(n, 3)).astype(np.float32) for n in (5, 20_000, 7)]
    trials[2][3] = trials[0][1]

    found = row_numbers(trials)

    assert [len(own) for own in found] == [5, 20_000, 7]
    assert found[2][3] == found[0][1]
    assert len(set(np.concatenate(found).tolist())) == 20_011
    np.testing.assert_array_equal(found[2], row_numbers(trials[2:])[0])


def test_one_fact_is_said_once_in_plain_words(make_set: Make) -> None:
    """A stream, its file and its recording are one to one; none says "imported_froms"."""
    touch = make_set["array"]()
    name = [f"{c}-{i % 4}" for i, c in enumerate(touch.y)]
    trials = [replace(trial, groups={**trial.groups, "stream": own})
              for trial, own in zip(touch.trials, name, strict=True)]  # fmt: skip
    files = tuple({"detail imported_from": f"{own}.npz"} for own in name)
    touch = replace(touch, trials=tuple(trials), files=files)
    case = make_case(touch, None, 10, 0)

    found = {reading.kind: reading.finding(reading.evidence.p) for reading in read_origins(case)}

    assert "name: stream" in found
    assert "name: imported file" not in found
    assert "one to one" in found["name: stream"].message
    assert "'imported file'" in found["name: stream"].message

    alone = replace(touch, trials=make_set["array"]().trials)
    found = {reading.kind: reading.finding(reading.evidence.p)
             for reading in read_origins(make_case(alone, None, 10, 0))}  # fmt: skip
    assert found["name: imported file"].mend.endswith("hold out whole files")


def test_several_of_a_group_are_named_as_in_english() -> None:
    """No "bodys" and no "batchs"."""
    assert [several(key) for key in ("session", "day", "body", "batch")] == [
        "sessions", "days", "bodies", "batches"]  # fmt: skip


@pytest.mark.parametrize("still", [False, True], ids=["press", "squeeze that starts late"])
def test_a_first_row_that_may_be_touch_is_asked_about(make_set: Make, still: bool) -> None:
    """A class's level in every row of trials that move away: a hazard with its condition.

    A hand that lies around an object before it squeezes stands still as an untouched sensor does;
    the squeeze, too, differs by class.
    """
    touch = make_set["array"]()
    x = np.clip((np.arange(40) - 8) / 4, 0, 1) if still else np.linspace(0.0, 1.0, 40)
    press = x[:, None] ** 0.5
    rng = np.random.default_rng(0)
    rows = tuple(np.asarray(rng.normal(0, 0.01, (40, 6)) + 2.0 * c + (4.0 + c) * press, np.float32)
                 for c in touch.y)  # fmt: skip
    spoilt = replace(touch, rows=rows)
    assert stands_still_first(spoilt) is still

    reading = read_first(make_case(spoilt, None, 10, 0))
    found = reading.finding(reading.evidence.p)

    assert found.verdict == "hazard"
    assert ("after they stood still" in found.message) is still
    assert "does not yet touch in the first row, it is drift" in found.message
    assert "may be touch itself" in found.message
    assert "in contact when the recording began?" in found.mend
    assert "(tare)" in found.mend


@pytest.mark.parametrize(
    ("course", "still"),
    [
        (np.clip((np.arange(40) - 8) / 4, 0, 1), True),
        (np.linspace(0, 1, 40), False),
        (np.linspace(0, 1, 40) ** 1.5, False),
        (1 - np.exp(-np.arange(40) / 3), False),
    ],
    ids=["onset", "press", "contact of a ball", "settling"],
)
def test_a_still_start_is_told_from_a_press_and_from_a_hold_that_settles(
    make_set: Make, course: np.ndarray, still: bool
) -> None:
    """Both leave their first row as well, but do not stand still there."""
    touch, rng = make_set["array"](), np.random.default_rng(0)
    rows = tuple((course[:, None] + rng.normal(0, 0.01, (40, 6))).astype(np.float32)
                 for _ in range(60))  # fmt: skip

    assert stands_still_first(replace(touch, rows=rows)) is still


def test_the_verdict_names_what_only_the_reader_knows() -> None:
    """No careless split is spoken of where the first row is all that waits."""
    first = Finding(kind="first frame", verdict="hazard", message="")
    other = Finding(kind="order", verdict="hazard", message="")
    leak = Finding(kind="length", verdict="leak", message="")

    def verdict(*findings: Finding) -> str:
        return Audit(data="d", kind="array", target="t", classes={}, split="", read_on="",
                     findings=findings).verdict  # fmt: skip

    assert verdict(first) == (
        "No leak found in these recordings, unless trials begin before contact (first frame)."
    )
    assert "would turn 1 hazard into a leak" in verdict(first, other)
    assert "and the first frame leaks if trials begin before contact" in verdict(leak, first)
