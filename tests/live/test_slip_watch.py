"""Live slip is the slip of the recording, and a bundle that warns of it runs live."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from taxel.bundles.grasp import contract_from_json, contract_to_json, read_grasp_bundle
from taxel.errors import BadBundle
from taxel.evaluation.early_warning.learn_slip_warning import (
    ReadyWarning,
    rule_model,
    rule_probability,
    write_warning,
)
from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.gel.rim_slip import WITH_RIM, RimSlip
from taxel.gel.ring_slip import WITH_RINGS
from taxel.gel.slip_signal import PAIR_FEATURES, GelSlip, PairSlip
from taxel.live.grasp_monitor import GraspMonitor
from taxel.live.slip_watch import SlipWatch, taken_of
from taxel.sources.simulated.stepped_pour import SteppedPour
from taxel.training.slip.cups import paper_runs, seen_pour, true_pours
from taxel.training.slip.onnx_graph import linear_model
from taxel.training.slip.pose_noise import settle
from taxel.training.slip.rim_features import rim_features, ring_features
from taxel.windows.pairs import FramePairer, FrameSet

CLOCK_S = 10.0
"""By how much the simulated cameras' own clocks are ahead."""


@cache
def pour_on(gel):
    run = next(run for run in paper_runs(31_000) if run.kind == "pour")
    batch = seen_pour(run, gel)
    stepped, pairer, sets = SteppedPour(run, gel=gel), FramePairer(2), []
    for _ in range(len(batch.time_s)):
        frames, _ = stepped.step()
        sets += [found for frame in frames if (found := pairer.push(frame)) is not None]
    return stepped.cameras, sets, batch


@pytest.fixture(scope="module")
def pour():
    """A pour that slips, its moments as sets of frames, and its batch poses."""
    return pour_on(1)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    """The rule without learning, as a bundle."""
    path = tmp_path_factory.mktemp("slip") / "rule.taxel"
    rows = np.abs(np.random.default_rng(0).normal(0, 0.1, (16, len(PAIR_FEATURES))))
    rows = rows.astype(np.float32)
    warning = ReadyWarning(
        model=rule_model(0.31), threshold=0.5, check=rows, expected=rule_probability(rows, 0.31)
    )
    write_warning(path, "rule", warning, {})
    return read_grasp_bundle(path)


def test_live_equals_batch_to_the_last_bit(pour):
    """Poses of `seen_pour`, through the same signal with the cameras' own times."""
    cameras, sets, batch = pour
    watch, live = SlipWatch(cameras), []
    for found in sets:
        live += watch.see(found)

    pair, before, offline = PairSlip(), [-1, -1], []
    for moment, found in enumerate(sets):
        for side, rows in enumerate(batch.gels):
            image = int(rows.shown[moment])
            if image != before[side]:
                pair.gels[side].push(
                    rows.object[image], rows.gel[image], rows.spread[image],
                    taken_of(found.frames[side]), bool(rows.seen[image]),
                )  # fmt: skip
                before[side] = image
        offline.append(pair.features())

    assert len(live) == len(offline) == len(sets)
    assert np.array_equal(np.stack(live), np.stack(offline))
    assert watch.slip == pair.slip


def test_what_an_exchanged_image_showed_is_forgotten(pour):
    """Once the earlier image is back, slip is as if that camera had sent none between."""
    cameras, sets, _ = pour
    spoiled, spared = (SlipWatch(cameras, columns=len(WITH_RINGS)) for _ in range(2))
    rows = {id(spoiled): [], id(spared): []}
    for number, found in enumerate(sets[:70]):
        left, right = found.frames
        if 40 <= number < 55:
            image = np.ascontiguousarray(decode_jpeg(right.jpeg, None)[:, ::-1])
            foreign = FrameSet((left, replace(right, jpeg=encode_jpeg(image))))
            rows[id(spoiled)] += spoiled.see(foreign)
        else:
            rows[id(spoiled)] += spoiled.see(found)
        if not 40 <= number < 62:
            rows[id(spared)] += spared.see(found)
        if number in (39, 54):
            assert spoiled.exchanged == (None if number == 39 else 1)
            assert spoiled.gels[1].seen == (number == 39)

    assert spoiled.exchanged is None
    assert spoiled.gels[1].distance_mm == pytest.approx(spared.gels[1].distance_mm, abs=1e-3)
    assert spoiled.gels[1].seen
    share = WITH_RINGS.index("rim_share_lost")
    last, expected = (each[-1][share] for each in rows.values())
    assert last == pytest.approx(expected, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("gel", [1, 2])
@pytest.mark.parametrize("kind", ["slip-rim", "slip-rings"])
def test_with_rims_and_rings_live_equals_what_was_learned_from(gel, kind, tmp_path):
    """To the last bit, through a bundle that says how many columns its windows have."""
    cameras, sets, batch = pour_on(gel)
    gels = tuple(
        replace(rows, taken_s=np.array([CLOCK_S + taken_s for taken_s in rows.taken_s]))
        for rows in batch.gels
    )
    columns = {"slip-rim": len(WITH_RIM), "slip-rings": len(WITH_RINGS)}[kind]
    features = {"slip-rim": rim_features, "slip-rings": ring_features}[kind]
    (learned,) = features([replace(batch, gels=gels)])
    watch, live = SlipWatch(cameras, columns=columns), []
    for found in sets:
        live += watch.see(found)

    assert all(rows.seen.all() for rows in batch.gels)
    assert np.array_equal(np.stack(live), learned.rows[learned.at])

    column = np.zeros(columns)
    column[-1] = 1.0
    path = tmp_path / "rim.taxel"
    expected = np.clip(learned.rows[:, -1], 0.0, 1.0)
    warning = ReadyWarning(
        model=linear_model(column), threshold=0.2, check=learned.rows, expected=expected
    )
    write_warning(path, "logistic", warning, {})
    bundle = read_grasp_bundle(path)
    monitor = GraspMonitor(bundle, cameras)
    answers = [monitor.push(found).probability for found in sets]

    assert bundle.contract.features == kind
    assert bundle.offset.shape == (1, columns)
    settled = np.isfinite(answers)
    assert settled.sum() > len(sets) - 30
    assert np.array(answers)[settled] == pytest.approx(expected[learned.at][settled], abs=1e-6)


def test_a_moment_of_an_older_clock_changes_nothing_of_the_rim():
    trend, pair = RimSlip(), np.full(len(PAIR_FEATURES), 0.1, np.float32)
    for moment in range(100):
        before = trend.push(pair * (moment / 100), 0.001 * moment, 0.0, moment / 50)
    again = trend.push(pair * 9, 0.5, 0.5, 1.0)

    assert np.array_equal(again, before)
    assert np.isfinite(before).all()


def test_a_bundle_whose_columns_are_not_those_it_names_is_refused(bundle):
    text = contract_to_json(bundle.contract).replace('"slip"', '"slip-rim"')
    with pytest.raises(BadBundle):
        contract_from_json(text)


@pytest.mark.slow
def test_the_monitor_warns_before_gross_slip(pour, bundle):
    cameras, sets, batch = pour
    monitor = GraspMonitor(bundle, cameras)
    answers = [monitor.push(found) for found in sets]

    event_s = batch.first_s(300.0)
    warned = [answer.time_s for answer in answers if answer.decision.alarm]
    assert event_s is not None
    assert warned
    assert 0.0 < event_s - warned[0] < 1.5
    assert answers[0].decision.slip is not None
    assert not answers[0].decision.slip.seen, "nothing is followed while the grasp settles"
    last = answers[-1].decision.slip
    assert last is not None
    assert last.seen
    assert last.distance_mm > 0.3
    assert len(answers[-1].gels) == 2


def test_slip_lies_within_its_own_spread_of_the_true_poses(pour):
    """Errors are of the size that is told, though those of one pour share their drift."""
    _, _, batch = pour
    true, sizes = true_pours([batch.run])[0], []
    for followed, exact in zip(batch.gels, true.gels, strict=True):
        exact, mine, its = settle(exact), GelSlip(), GelSlip()
        for i, taken_s in enumerate(followed.taken_s):
            spread = followed.spread[i]
            mine.push(followed.object[i], followed.gel[i], spread, taken_s, bool(followed.seen[i]))
            its.push(exact.object[i], exact.gel[i], spread, taken_s)
            if taken_s > 0.4 and its.slip.distance_mm < 0.4:
                off = mine.slip.distance_mm - its.slip.distance_mm
                sizes.append(off / mine.slip.distance_sd_mm)

    assert len(sizes) > 60
    assert 0.2 < np.sqrt(np.mean(np.square(sizes))) < 2.5
