"""Claims about learning a monitor and judging it: what a head has seen is never what it is worth.

Features are made up, so that what can be learned is known: one channel a camera that rises with
the label, or one whose sign depends on the cup and so says nothing of another cup.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from taxel.decisions.stability import StabilityConfig
from taxel.errors import BadDataset
from taxel.evaluation.early_warning.grasp_warnings import (
    INNER_FOLDS,
    split_by_folder,
    warn_on_unseen_cups,
    warn_trivially,
)
from taxel.evaluation.early_warning.learn_monitor import check_alike, learn_monitor
from taxel.evaluation.transitions import tables
from taxel.evaluation.transitions.data import DIFFERENCE, CameraSet, cup_folds
from taxel.evaluation.transitions.tables import (
    LARGEST_DIFFERENCE,
    BackboneSeen,
    measure_rows,
    plan_rows,
    trivial_rows,
)
from taxel.labels.slip import label_truth
from taxel.signals import CameraInfo, SensorInfo
from taxel.sim.pour.state import TRUTH_CHANNELS, TRUTH_UNITS
from taxel.training.frames.features import FrameFeatures
from taxel.training.frames.heads import HeadConfig
from taxel.windows.camera_recordings import CameraRecording

FRAMES, SEEN, GROSS = 100, 50, 60
"""At 60 Hz; the frames from which a slip can be seen, and is gross."""
CUPS = 3
CAMERA = CameraInfo(name="left", width=320, height=240, rate_hz=60.0)
CONFIG = HeadConfig(frames=8, epochs=6, stride=2, batch=8, learning_rate=0.02, ahead=GROSS - SEEN)
"""Labels run ahead by as much as a slip can be seen before it is gross."""


def pour(cup: int, slips: bool) -> CameraRecording:
    """Return a pour of a cup: its slip passes 20 µm at `SEEN` and 300 µm at `GROSS`."""
    frame = np.arange(FRAMES)
    truth = np.zeros((FRAMES, len(TRUTH_CHANNELS)), np.float32)
    if slips:
        truth[:, TRUTH_CHANNELS.index("slip")] = 30.0 * np.clip(frame - SEEN + 1, 0, None)
    return CameraRecording(
        path=Path(f"cup-{cup}-{slips}.mcap"), groups={"cup": f"{cup}"}, labels={},
        cameras=(CAMERA, CAMERA),
        sensor=SensorInfo(name="truth", channels=TRUTH_CHANNELS, units=TRUTH_UNITS, rate_hz=60.0),
        time_s=frame / 60.0, image=np.stack([frame, frame], axis=1), beside=truth,
        digest=f"{cup} {slips}",
        turned=f"{cup} {slips}",
    )  # fmt: skip


def pours_of(cups: int, rule: str = "gross-slip") -> CameraSet:
    """Return a pour that slips and one that holds of each cup."""
    pours = tuple(pour(cup, slips) for cup in range(cups) for slips in (True, False))
    labels = tuple(label_truth(own.beside, "gross-slip") for own in pours)
    signals = tuple(np.zeros((FRAMES, 2), np.float32) for _ in pours)
    return CameraSet(pours=pours, rule=rule, labels=labels, signals=signals)


def features_of(data: CameraSet, *, shared: bool) -> list[FrameFeatures]:
    """Return noise in which a slip shows in the first channel, or else in each cup's own."""
    rng = np.random.default_rng(0)
    found = []
    for own in data.pours:
        values = rng.normal(0.0, 0.02, (FRAMES, 5)).astype(np.float32)
        visible = own.beside[:, TRUTH_CHANNELS.index("slip")] > 20.0
        values[visible, 0 if shared else int(own.groups["cup"])] += 1.0
        found.append(FrameFeatures(values, own.image))
    return found


def test_a_slip_that_every_cup_shows_alike_is_warned_of_before_it_is_gross() -> None:
    data = pours_of(CUPS)
    learnt = learn_monitor(data, features_of(data, shared=True), CONFIG)

    assert learnt.windows is not None
    assert learnt.windows.windows == 2 * CUPS * (FRAMES - CONFIG.frames + 1)
    assert learnt.windows.auc > 0.95
    assert learnt.tuned is not None
    assert learnt.stability == learnt.tuned.config
    assert (learnt.tuned.missed_share, learnt.tuned.false_alarms_per_min) == (0.0, 0.0)
    assert 0.05 < learnt.tuned.lead_median_s <= (GROSS - SEEN) / 60.0 + 1e-9


def test_a_monitor_is_worth_what_it_does_on_cups_that_its_head_has_not_seen() -> None:
    """Each cup slips in a channel of its own: the head knows them all, no other cup's head does."""
    data = pours_of(CUPS)
    features = features_of(data, shared=False)
    learnt = learn_monitor(data, features, CONFIG)
    known = [learnt.head.probabilities(found.all()).max() for found in features]

    assert min(known[0::2]) > 0.8 > 0.5 > max(known[1::2])
    assert learnt.windows is not None
    assert learnt.windows.balanced < 0.6


def test_each_group_of_cups_is_held_out_once_and_then_all_are_learned() -> None:
    data = pours_of(5)
    lines: list[str] = []
    learn_monitor(
        data, features_of(data, shared=True), replace(CONFIG, epochs=1), on_step=lines.append
    )

    assert len(lines) == INNER_FOLDS + 1
    assert lines == ["without cup 0, 1", *(f"without cup {n}" for n in (2, 3, 4)), "all cups"]


def test_a_recording_shorter_than_a_window_is_left_out_and_tunes_nothing() -> None:
    data = pours_of(CUPS)
    features = features_of(data, shared=True)
    few, frames = 14, 16
    short = replace(data.pours[0], time_s=data.pours[0].time_s[:few],
                    image=data.pours[0].image[:few], beside=data.pours[0].beside[:few])  # fmt: skip
    some = replace(
        data, pours=(short, *data.pours[1:]), labels=(data.labels[0][:few], *data.labels[1:])
    )
    cut = FrameFeatures(features[0].values[:few], features[0].row[:few])
    config = replace(CONFIG, epochs=1, frames=frames)
    learnt = learn_monitor(some, [cut, *features[1:]], config)
    trivial = warn_trivially(
        some, lambda i: some.pours[i].beside[:, 0], cup_folds(some.cups()), name="n", frames=frames
    )

    assert learnt.windows is not None
    assert learnt.windows.windows == (2 * CUPS - 1) * (FRAMES - frames + 1)
    assert learnt.tuned is not None
    assert trivial.tests == (1, 2, 3, 4, 5)


def test_one_cup_gives_a_monitor_of_unknown_worth_with_the_usual_thresholds() -> None:
    data = pours_of(1)
    learnt = learn_monitor(data, features_of(data, shared=True), CONFIG)

    assert (learnt.windows, learnt.tuned) == (None, None)
    assert learnt.stability == StabilityConfig()


def test_labels_from_images_are_scored_and_tune_nothing() -> None:
    data = pours_of(2, rule="change")
    learnt = learn_monitor(data, features_of(data, shared=True), CONFIG)

    assert learnt.tuned is None
    assert learnt.windows is not None
    assert learnt.windows.auc > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("shared", [True, False])
def test_warnings_are_judged_on_each_unseen_cup_once(shared: bool) -> None:
    data = pours_of(CUPS)
    folds = cup_folds(data.cups())
    found, _ = warn_on_unseen_cups(
        data, features_of(data, shared=shared), CONFIG, folds, name="made up"
    )

    assert sorted(found.tests) == list(range(2 * CUPS))
    assert len(found.tuned) == len(folds) == CUPS
    assert (found.events.runs, found.events.events, found.events.clusters) == (6, 3, 3)
    if shared:
        assert (found.events.missed_share, found.events.false_alarms) == (0.0, 0)
        assert 0.05 < found.events.lead_median_s <= (GROSS - SEEN) / 60.0 + 1e-9
    else:
        assert found.events.missed_share > 0.5
        assert found.windows.balanced < 0.6


def test_a_trivial_number_is_ranked_among_training_cups_alone() -> None:
    """A test cup whose numbers lie above all that was learned from is as sure as can be."""
    data = pours_of(2)
    columns = [np.where(label_truth(own.beside, "slip"), 1.0, 0.0) + own.beside[:, 0] / 1e6
               for own in data.pours]  # fmt: skip
    columns[2] = columns[2] + 9.0
    (fold,) = [fold for fold in cup_folds(data.cups()) if fold.name == "1"]
    found = warn_trivially(data, lambda i: columns[i], [fold], name="number", frames=8)

    assert found.tests == (2, 3)
    assert set(found.probabilities[0].tolist()) == {np.float32(0.999)}
    assert found.probabilities[1].max() < 0.5


def test_no_warning_is_judged_where_one_cup_alone_is_learned_from() -> None:
    data = pours_of(2)
    with pytest.raises(BadDataset, match="at least two of the group cup"):
        warn_on_unseen_cups(
            data, features_of(data, shared=True), CONFIG, cup_folds(data.cups()), name="x"
        )


def test_a_test_folder_shares_no_cup_with_what_is_learned_from() -> None:
    data, other = pours_of(2), pours_of(3)
    with pytest.raises(BadDataset, match="cup 0, 1 in both"):
        split_by_folder(data, other)
    third = replace(other, pours=other.pours[4:], labels=other.labels[4:],
                    signals=other.signals[4:])  # fmt: skip
    both, (fold,) = split_by_folder(data, third)

    assert both.cups().tolist() == ["0", "0", "1", "1", "2", "2"]
    assert (fold.train, fold.test) == ({0, 1, 2, 3}, {4, 5})


def test_a_table_s_row_holds_out_the_last_cup_and_then_each(monkeypatch) -> None:
    """Every cup shows its slip alike but the last, whose row is the paper's single split."""
    monkeypatch.setattr(tables, "side_by_side", partial(tables.side_by_side, workers=1))
    data = pours_of(3)
    features = features_of(data, shared=True)
    features[4] = features[5]  # nothing to be seen of its slip
    plans = [plan for plan in plan_rows(("efficientnet-lite0",))
             if plan.model == "efficientnet-lite0+lstm" and plan.frames in (8, 9)]  # fmt: skip
    done: list[str] = []
    rows = measure_rows(
        data, {"efficientnet-lite0": BackboneSeen("made up", features)}, plans,
        replace(CONFIG, ahead=0), on_row=done.append,
    )  # fmt: skip

    assert [row.plan.frames for row in rows] == [8, 9]
    assert done == ["efficientnet-lite0+lstm"] * 2
    eight, nine = rows
    assert nine.every_cup is None
    assert eight.every_cup is not None
    assert (eight.single.windows, eight.every_cup.windows) == (2 * 93, 6 * 93)
    assert nine.single.windows == 2 * 92
    assert eight.single.auc < 0.7 < eight.every_cup.auc
    assert eight.weights == "made up"
    assert eight.size_mb == eight.parameters * 4 / 2**20


def test_a_model_with_a_backbone_of_its_own_is_judged_by_what_that_one_saw(monkeypatch) -> None:
    monkeypatch.setattr(tables, "side_by_side", partial(tables.side_by_side, workers=1))
    data = pours_of(3)
    plans = [plan for plan in plan_rows(("efficientnet-lite0",))
             if plan.model in ("efficientnet-lite0+lstm", "efficientnet-lite0+transformer")
             and plan.frames == 8]  # fmt: skip
    seen = {
        "efficientnet-lite0": BackboneSeen("shared", features_of(data, shared=True)[:1] * 6),
        "efficientnet-lite0+lstm": BackboneSeen("own", features_of(data, shared=True), "said"),
    }
    rows = {row.plan.model: row for row in measure_rows(
        data, seen, plans, replace(CONFIG, ahead=0), every_cup=False
    )}  # fmt: skip

    own, other = rows["efficientnet-lite0+lstm"], rows["efficientnet-lite0+transformer"]
    assert (own.weights, own.origin, other.weights) == ("own", "said", "shared")
    assert own.single.accuracy > other.single.accuracy + 0.1


def test_trivial_answers_stand_beside_a_table() -> None:
    """The frame's number predicts a slip that always comes at the same frame; a class does not."""
    data = pours_of(3)
    slipping = replace(data, pours=data.pours[::2], labels=data.labels[::2],
                       signals=data.signals[::2])  # fmt: skip
    rows = {row.name: row for row in trivial_rows(slipping)}

    assert list(rows) == [
        "frame index", DIFFERENCE, "pour started (not seen by the sensor)",
        LARGEST_DIFFERENCE, "the commonest class",
    ]  # fmt: skip
    assert rows["frame index"].every_cup.accuracy == 1.0
    unstable = (FRAMES - GROSS) / (FRAMES - 7)
    for name in (DIFFERENCE, "the commonest class"):
        assert rows[name].every_cup.accuracy == pytest.approx(1.0 - unstable)
        assert rows[name].every_cup.balanced == 0.5


def test_a_window_s_largest_difference_sees_what_its_last_frame_no_longer_shows() -> None:
    data = pours_of(3)
    moment = np.zeros(FRAMES, np.int8)
    moment[20:40] = 1
    signal = np.stack([2.0 * moment, moment], axis=1).astype(np.float32)
    touched = replace(data, labels=(moment,) * len(data.pours), signals=(signal,) * len(data.pours))
    rows = {row.name: row for row in trivial_rows(touched)}

    assert rows[LARGEST_DIFFERENCE].every_cup.accuracy == 1.0
    windows = FRAMES - 7
    assert rows[DIFFERENCE].every_cup.accuracy == pytest.approx((windows - 7) / windows)


def test_recordings_that_no_bundle_serves_together_are_refused() -> None:
    data = pours_of(2)
    check_alike(data.pours)
    slow = replace(data.pours[1], path=Path("slow.mcap"), time_s=data.pours[1].time_s * 1.3)
    with pytest.raises(BadDataset, match=r"60 frames/s in cup-0-True.mcap and 46\.2 in slow"):
        check_alike([data.pours[0], slow])
    check_alike([data.pours[0], replace(slow, time_s=data.pours[1].time_s * 1.2)])
    small = replace(data.pours[1], cameras=(CAMERA, replace(CAMERA, width=CAMERA.width // 2)))
    with pytest.raises(BadDataset, match="images of one size"):
        check_alike([data.pours[0], small])


def test_a_recording_of_no_cup_is_refused_by_what_an_import_can_add() -> None:
    """No verb takes another group than the cup, though the message spoke of naming one."""
    data = pours_of(1)
    lone = replace(data, pours=(replace(data.pours[0], groups={"object": "mug"}), *data.pours[1:]))
    with pytest.raises(BadDataset, match="import again with a column group:cup in the table, or"):
        lone.cups()
