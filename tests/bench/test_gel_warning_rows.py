"""Claims about the rows on warnings with gels that shear as layers."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.bench.transitions import gel_warning, slip_warning
from taxel.bench.transitions.gel_kinds import judge_kinds
from taxel.bench.transitions.gel_warning import judge_rows, rendered
from taxel.bench.transitions.slip_warning import Warner, shipped_warner
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.evaluation.early_warning.learn_slip_warning import rule_drive
from taxel.gel.ring_slip import RING_FEATURES
from taxel.gel.slip_signal import TURN_MM
from taxel.sim.pour.cup_pour import Gel
from taxel.sim.pour.cups import OTHER_KINDS
from taxel.training.slip.cups import (
    TEST_CUPS,
    GelRows,
    PourRows,
    keep_runs,
    paper_part,
    paper_runs,
    seen_pours,
)
from taxel.training.slip.rim_features import ring_features


def turns(cup: int, by_mm: float, gives_mm: float) -> PourRows:
    """Return a pour whose cup turns evenly from 1 s on, by so much at the patch's lever."""
    run = replace(paper_runs(cup)[0], kind="pour")
    taken_s, time_s = np.arange(125) / 25.0, np.arange(300) / 60.0
    share = np.clip(taken_s - 1.0, 0.0, 1.0)[:, None] * [0.0, 0.0, 1.0 / TURN_MM]
    gel = GelRows(
        taken_s=taken_s, object=(by_mm + gives_mm) * share, gel=gives_mm * share,
        spread=np.zeros((125, 3)), seen=np.ones(125, np.bool_),
        shown=np.minimum(np.arange(300) * 25 // 60, 124), rim=gives_mm * share / 2,
        rings=np.zeros((125, len(RING_FEATURES))),
    )  # fmt: skip
    slip_um = 1000.0 * by_mm * np.clip(time_s - 1.0, 0.0, 1.0)
    return PourRows(run, time_s, slip_um, np.zeros(300, np.bool_), (gel, gel))


def test_both_gels_are_judged_on_the_same_pours_and_only_one_row_pair_has_goals():
    pours = [turns(TEST_CUPS[number], by_mm, 0.1) for number, by_mm in enumerate((1.0, 0.0))]
    found: dict[Gel, list[PourRows]] = {1: pours, 2: pours}
    names = ("learned on gel 1, as shipped", "learned on gel 2")
    rows = judge_rows([Warner(name, rule_drive, 0.3, "") for name in names], found)
    named = {row.name: row for row in rows}

    assert {name for name, row in named.items() if row.ok is not None} == {
        "slip warning, learned on gel 2, on gel 2: median lead before 300 um",
        "slip warning, learned on gel 2, on gel 2: false alarms",
    }
    for name in names:
        one, two = (named[f"slip warning, {name}, on gel {gel}: missed"] for gel in (1, 2))
        assert one.value == two.value == 0.0
        assert named[f"slip warning, {name}, on gel 2: false alarms"].value == 0.0
        lead = named[f"slip warning, {name}, on gel 2: median lead before 300 um"].value
        assert lead is not None
        assert lead > 0.05


def test_only_parts_that_are_kept_with_both_gels_count(tmp_path):
    cup = TEST_CUPS[0]
    runs = paper_part(cup, 0)
    pours = [replace(turns(cup, 0.0, 0.1), run=run) for run in runs]
    keep_runs(tmp_path / f"{cup}-paper-0.npz", runs, lambda _: pours)
    assert rendered(tmp_path) == {1: [], 2: []}

    keep_runs(tmp_path / f"{cup}-paper-0-gel-2.npz", runs, lambda _: pours)
    found = rendered(tmp_path)
    assert [each.run for each in found[1]] == [each.run for each in found[2]] == runs


def test_nothing_rendered_is_no_row_with_a_value():
    (row,) = judge_rows([], {1: [], 2: []})
    assert row.value is None


def test_a_layer_changes_what_the_gel_does_and_neither_the_cup_nor_what_happens():
    runs = paper_runs(31_000)[:1]
    (first,), (second,) = seen_pours(runs, 1), seen_pours(runs, 2)

    assert second.slip_um == pytest.approx(first.slip_um, abs=1e-6)
    event_s = first.first_s(300.0)
    assert event_s is not None
    for rigid, layer in zip(first.gels, second.gels, strict=True):
        assert np.array_equal(rigid.shown, layer.shown)
        before = rigid.taken_s < event_s
        last = int(np.flatnonzero(before)[-1])
        assert np.abs((layer.object - rigid.object)[before]).max() < 0.06
        assert np.abs((layer.gel - rigid.gel)[before]).max() > 0.005
        assert layer.rings[last, 0] > layer.rings[last, 5] + 0.2  # the outside stays behind


@pytest.mark.parametrize("name", gel_warning.SHIPPED)
def test_a_shipped_warning_is_taken_as_it_is(name):
    warner = shipped_warner(name)
    (found,) = ring_features([turns(TEST_CUPS[0], 1.0, 0.1)])
    drive = warner.drive(found)
    bundle = read_grasp_bundle(shipped_bundle(name))
    windows = (found.rows[:, : bundle.offset.size] - bundle.offset) * bundle.factor
    expected = [bundle.probability(window[None, None]) for window in windows]
    assert drive == pytest.approx(np.array(expected)[found.at], abs=1e-6)
    assert drive.max() > warner.threshold > drive[0]


@pytest.mark.parametrize("name", gel_warning.SHIPPED)
def test_a_shipped_warning_warns_of_a_straight_slide_too(name):
    """An object that is pulled out without turning, 3 mm in a second."""
    turned = turns(TEST_CUPS[0], 3.0, 0.1)
    straight = tuple(
        replace(rows, object=rows.object[:, [2, 2, 0]] * [0.0, TURN_MM, 0.0])
        for rows in turned.gels
    )
    warner = shipped_warner(name)
    (found,) = ring_features([replace(turned, gels=straight)])
    drive = warner.drive(found)
    assert drive.max() > warner.threshold > drive[0]


def test_what_ships_is_judged_as_it_ships_and_alone_has_goals(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(slip_warning, "COMPARED", ())
    test = ring_features([turns(TEST_CUPS[0], 1.0, 0.1), turns(TEST_CUPS[1], 0.0, 0.1)])
    named = {row.name: row for row in slip_warning.judge_rows([], test)}

    forecast = named["slip warning, forecast: median lead before 300 um, cups never seen"]
    warner = shipped_warner(CUP_POUR)
    warned_s = float(test[0].pour.time_s[np.argmax(warner.drive(test[0]) >= warner.threshold)])
    event_s = test[0].pour.first_s(300.0)
    assert event_s is not None
    assert forecast.value == pytest.approx(event_s - warned_s)
    assert f"threshold {warner.threshold:.3f}" in forecast.note
    assert named["slip warning, forecast: false alarms"].value == 0.0
    assert named["slip warning, the rule without learning: false alarms"].value == 0.0


def test_other_grasps_have_a_row_of_false_alarms_and_one_of_misses_for_each_kind():
    pours = [
        replace(pour, run=replace(pour.run, kind=kind))
        for kind in OTHER_KINDS
        for pour in (turns(TEST_CUPS[0], 1.0, 0.1), turns(TEST_CUPS[1], 0.0, 0.1))
    ]
    kinds = {kind: (kind,) for kind in OTHER_KINDS} | {"all": OTHER_KINDS}
    judged = judge_kinds([Warner("rule", rule_drive, 0.3, "")], pours, "g", kinds)
    rows = {row.name: row for row in judged}

    assert len(rows) == 2 * len(kinds)
    assert f"{len(OTHER_KINDS)} slips," in rows["slip warning, rule, all, g: missed"].note
    for kind in OTHER_KINDS:
        assert rows[f"slip warning, rule, {kind}, g: missed"].value == 0.0
        assert "1 slip," in rows[f"slip warning, rule, {kind}, g: missed"].note
        assert rows[f"slip warning, rule, {kind}, g: false alarms"].value == 0.0


def test_a_kind_that_nothing_is_rendered_of_has_no_value():
    pours, kinds = [turns(TEST_CUPS[0], 0.0, 0.1)], {"lift": ("lift",), "tilt": ("tilt",)}
    rows = judge_kinds([Warner("rule", rule_drive, 0.3, "")], pours, "g", kinds)
    assert [row.value for row in rows] == [None, None]
