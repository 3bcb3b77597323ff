"""Names that only look like files, alike trials that give nothing away, and labels in channels."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from taxel.evaluation.audit.audit import audit, make_case
from taxel.evaluation.audit.copies import exact_copies
from taxel.evaluation.audit.copy_findings import Alike, shared_copies
from taxel.evaluation.audit.evidence import sign_p
from taxel.evaluation.audit.finding import Audit, Finding
from taxel.evaluation.audit.label_channels import label_channels
from taxel.evaluation.audit.origins import read_origins
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.sides import named_sides
from taxel.evaluation.audit.touch_set import TouchSet, usual_steps
from taxel.recordings.imports.importing import import_table

Make = dict[str, Callable[..., TouchSet]]
Pair = tuple[int, int]


def names(touch: TouchSet, split: str | None = None) -> dict[str, Finding]:
    """Return what names predict the label, each without correction."""
    sides = None if split is None else named_sides(touch, split, 4, 5, 0)
    return {reading.kind: reading.finding(reading.evidence.p)
            for reading in read_origins(make_case(touch, sides, 4, 0))}  # fmt: skip


def imported(folder: Path, table: str) -> TouchSet:
    """Return the trials that an import table describes."""
    (folder / "t.csv").write_text(table)
    import_table(folder / "t.csv", folder / "set")
    return read_touch(folder / "set", "sign", lambda *_: None)


def test_files_of_one_name_in_several_folders_are_several(tmp_path: Path) -> None:
    """Persons have files of the same names, with the label in them: nothing that a model sees."""
    rng = np.random.default_rng(0)
    for person in range(5):
        (tmp_path / f"p{person}").mkdir()
        for sign in "abcd":
            for take in (1, 2):
                np.savetxt(tmp_path / f"p{person}" / f"{sign}-{take}.csv", rng.normal(size=(8, 2)),
                           delimiter=",", header="x,y", comments="")  # fmt: skip
    touch = imported(tmp_path, "file,channels,time\n"
                     '{group:person}/{label:sign}-*.csv,x[N] y[N],rate:10Hz\n')  # fmt: skip

    assert len({of["detail imported_from"] for of in touch.files}) == 8
    for split in (None, "group:person"):
        assert "name: imported file" not in names(touch, split)


@pytest.mark.parametrize(("word", "verdict"), [("", "leak"), ("sign_", "hazard")])
def test_one_file_for_each_class_is_asked_about_where_its_name_is_the_label(
    tmp_path: Path, word: str, verdict: str
) -> None:
    """Three files of 20 trials each: recorded one after another, or sorted by class since."""
    rng = np.random.default_rng(0)
    called = ["a", "b", "c"] if word else ["x", "y", "z"]
    for name in called:
        np.save(tmp_path / f"{word}{name}.npy", rng.normal(size=(20, 8, 2)))
    lines = "".join(f"{word}{name}.npy,trials rows channels,x[N] y[N],rate:10Hz,{sign}\n"
                    for name, sign in zip(called, "abc", strict=True))  # fmt: skip
    touch = imported(tmp_path, f"file,axes,channels,time,label:sign\n{lines}")

    for split in (None, "group:recording"):
        found = names(touch, split)["name: imported file"]
        assert found.verdict == verdict
        assert found.alone == 1.0
        assert ("recorded at different times" in found.message) == (verdict == "hazard")


def alike(touch: TouchSet, pairs: list[Pair], sure: list[Pair] | None = None) -> Finding:
    """Return what is found of trials that are alike, under a split by sessions."""
    sides = named_sides(touch, "group:session", usual_steps(touch), 5, 0)
    case = make_case(touch, sides, usual_steps(touch), 0)
    return shared_copies(case, "near-duplicates", dict.fromkeys(pairs, 0.999), "are copies",
                         alike=Alike(sure or [], "are alike"))  # fmt: skip


def across(touch: TouchSet, count: int, *, same: bool) -> list[Pair]:
    """Return pairs of two sessions, without the commonest class, that have no trial in common."""
    session = touch.group("session")
    assert session is not None
    usual = np.bincount(touch.y).argmax()
    free = [i for i in range(len(touch)) if touch.y[i] != usual]
    found: list[Pair] = []
    while len(found) < count:
        a = free.pop(0)
        b = next(b for b in free if session[a] != session[b] and same == (touch.y[a] == touch.y[b]))
        free.remove(b)
        found.append((a, b))
    return found


def test_a_sign_test_counts_tails() -> None:
    """Seven of seven are one case in 128; as many lost as gained are no evidence."""
    assert sign_p(7, 0) == pytest.approx(1 / 128)
    assert sign_p(1, 0) == pytest.approx(0.5)
    assert sign_p(0, 0) == 1.0
    assert sign_p(5, 5) > 0.5


def test_what_knowing_a_copys_label_gains_decides_whether_alike_trials_leak(
    make_set: Make,
) -> None:
    """Ten pairs with the label: a leak. Six: too few to show it. Ten without it: a note."""
    touch = make_set["array"]()
    leak = alike(touch, across(touch, 10, same=True))
    few = alike(touch, across(touch, 6, same=True))
    none = alike(touch, across(touch, 10, same=False))

    assert (leak.verdict, few.verdict, none.verdict) == ("leak", "hazard", "note")
    assert leak.alone is not None
    assert leak.majority is not None
    assert leak.alone > leak.majority
    assert "if one touch was repeated it is none" in few.message
    assert "gains no more than chance" in none.message


def test_trials_that_are_all_alike_are_one_case(make_set: Make) -> None:
    """Twenty trials of one class, in five sessions, are right together: no ten cases."""
    touch = make_set["array"]()
    own = np.flatnonzero(touch.y == 1).tolist()

    assert len(own) == 20
    assert alike(touch, list(pairwise(own))).verdict == "hazard"


def test_what_concerns_hardly_any_tested_trial_is_a_note_unless_it_is_a_copy(
    make_set: Make,
) -> None:
    """A pair in 600 trials; exact copies stay a leak, whose headline says how little it is."""
    touch = make_set["array"](trials=600)
    pairs = across(touch, 1, same=True)
    repeat, copy = alike(touch, pairs), alike(touch, pairs, sure=pairs)

    assert (repeat.verdict, copy.verdict) == ("note", "leak")
    assert "training trial: trials are alike" in repeat.message
    assert repeat.message.endswith("gains next to nothing.")
    assert copy.at_most == pytest.approx(2 / 600)
    assert "2 of 600 tested trials share this with a training trial: trials are copies" in (
        copy.message
    )
    assert "can change the accuracy by 0.003 at most" in copy.message
    assert headline(copy) == (
        "1 leak under the split 's': it can change the accuracy by 0.003 at most; mend it, or "
        "state it beside the result."
    )
    assert headline(replace(copy, at_most=0.02)).endswith("do not publish yet.")
    assert headline(copy, Finding(kind="length", verdict="leak", message="")).endswith(
        "do not publish yet."
    )
    assert headline(replace(repeat, verdict="hazard")) == (
        "No leak found under the split 's', unless trials were copied (near-duplicates)."
    )


def headline(*findings: Finding) -> str:
    return Audit(data="d", kind="array", target="t", classes={}, split="s", read_on="",
                 findings=findings).verdict  # fmt: skip


def test_exact_copies_are_distinguished_from_alike_trials(make_set: Make) -> None:
    """Scaled, or run backwards: exact. With one in a hundred of noise: alike."""
    touch = make_set["array"]()
    rows, rng = list(touch.rows), np.random.default_rng(0)
    rows[1] = np.asarray(1.3 * rows[0] + 2.0, np.float32)
    rows[3] = rows[2][::-1].copy()
    rows[5] = np.asarray(rows[4] + rng.normal(0, 0.01, rows[4].shape), np.float32)
    rows[7] = rows[6][::-1][3:].copy()
    touch = replace(touch, rows=tuple(rows))

    pairs = {(0, 1): 1.0, (2, 3): 1.0, (4, 5): 1.0, (6, 7): 1.0, (8, 9): 1.0}
    assert exact_copies(touch, pairs) == {(0, 1), (2, 3), (6, 7)}
    assert not exact_copies(touch, {})


def test_pairs_that_are_named_are_those_that_the_split_parts(make_set: Make) -> None:
    """A pair within one session is more alike, but the split keeps it together."""
    touch = make_set["array"]()
    inside, parted = (0, 15), (1, 17)
    sides = named_sides(touch, "group:session", usual_steps(touch), 5, 0)
    case = make_case(touch, sides, usual_steps(touch), 0)
    assert touch.y[0] == touch.y[15]
    assert touch.y[1] == touch.y[17]

    found = shared_copies(case, "duplicates", {inside: 1.0, parted: 0.9}, "hold the same rows")

    assert found.examples == ("r01#0 and r17#0 (90.0 % of the rows in common)",)
    odd = shared_copies(case, "duplicates", {(0, 5): 1.0, parted: 0.9}, "hold the same rows")
    assert (
        odd.examples[0] == "r00#0 [c0] and r05#0 [c1] (100.0 % of the rows in common, on one side)"
    )


def test_of_two_labels_nobody_knows_which_is_right(make_set: Make) -> None:
    """Both are to be left out; of copies that agree, one is kept."""
    touch = make_set["array"]()
    odd, even = (0, 6), (1, 17)
    assert touch.y[0] != touch.y[6]
    for split in (None, "group:session"):
        sides = split and named_sides(touch, split, usual_steps(touch), 5, 0)
        case = make_case(touch, sides or None, usual_steps(touch), 0)

        def mend(*pairs: Pair, case=case) -> str:  # type: ignore[no-untyped-def]
            return shared_copies(case, "duplicates", dict.fromkeys(pairs, 1.0), "are equal").mend

        assert mend(odd).startswith("leave out both trials of a pair with two different labels")
        assert "keep one of each" not in mend(odd)
        assert "of the others keep one of each" in mend(odd, even)
        assert mend(even).startswith("keep one of each")


def with_labels(touch: TouchSet) -> TouchSet:
    """Return trials of three classes with two more channels that name the class together."""
    rows = []
    for own, c in zip(touch.rows, touch.y, strict=True):
        labels = np.array([c > 0, c > 1], np.float32)
        rows.append(np.hstack([own, np.tile(labels, (len(own), 1))]))
    return replace(touch, rows=tuple(rows), views=("array",) * 8,
                   channels=(*"abcdef", "size", "hard"))  # fmt: skip


def test_channels_that_hold_the_label_are_named_and_left_out_of_all_other_checks(
    make_set: Make,
) -> None:
    """Two columns of labels beside six channels: neither first row nor level is blamed."""
    touch = make_set["array"]()
    found = {finding.kind: finding for finding in audit(with_labels(touch), "x").findings}
    clean = {finding.kind: finding for finding in audit(touch, "x").findings}

    leak = found["label channels"]
    assert leak.verdict == "leak"
    assert leak.alone == 1.0
    assert leak.message.startswith("The channels size, hard have one value in each trial")
    assert leak.mend.startswith("leave size, hard out of the import")
    assert clean["label channels"].verdict == "clear"
    for kind in ("level", "first frame"):
        assert found[kind].alone == clean[kind].alone


def test_what_stands_still_for_other_reasons_holds_no_label(make_set: Make) -> None:
    """A dead channel, an offset of each trial's own, a setting that classes share."""
    touch = make_set["array"]()
    for of in (lambda i: 0.0, lambda i: i / 7, lambda i: float(i % 2)):
        rows = [np.hstack([own, np.full((len(own), 1), of(i), np.float32)])
                for i, own in enumerate(touch.rows)]  # fmt: skip
        assert not len(label_channels(replace(touch, rows=tuple(rows))))
    single = tuple(own[:1] for own in with_labels(touch).rows)
    assert not len(label_channels(replace(touch, rows=single)))
    assert label_channels(with_labels(touch)).tolist() == [6, 7]
