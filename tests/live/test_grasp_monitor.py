"""Claims about the live grasp monitor: what it tells is what training measured, or UNKNOWN."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.engine import open_engine
from taxel.bundles.envelope import is_grasp_bundle
from taxel.bundles.grasp import (
    GraspBundle,
    GraspContract,
    contract_from_json,
    contract_to_json,
    read_grasp_bundle,
    write_grasp_bundle,
)
from taxel.decisions.reasons import REASONS
from taxel.decisions.stability import Stability, StabilityConfig
from taxel.errors import BadBundle
from taxel.live.grasp_monitor import GraspMonitor
from taxel.live.grasp_session import run_grasp_session
from taxel.models.export_onnx import export_head
from taxel.recordings.reader import iterate_frames
from taxel.signals import CameraInfo, Frame, Mark
from taxel.sources.opening import open_source
from taxel.training.frames.extractors import BackboneExtractor, SlipExtractor, open_backbone
from taxel.training.frames.features import extract
from taxel.training.frames.heads import HeadConfig, Track, TrainedHead, fit_head
from taxel.windows.camera_recordings import CameraRecording, frame_sets, read_camera_recordings
from taxel.windows.pairs import FrameSet
from taxel.windows.rest import SETTLE

EVER = StabilityConfig(raise_s=0.0, clear_s=0.0, warn=0.5, clear=0.5, unstable=0.8)


CAMERAS = tuple(
    CameraInfo(name=name, width=320, height=240, rate_hz=60.0) for name in ("left", "right")
)


def test_the_cameras_of_a_bundle_in_another_order_are_refused(few_pours: Path, tmp_path: Path):
    """A head knows them by their place alone; what it never heard of is taken as it comes."""
    bundle, *_ = make(tmp_path, read_camera_recordings(few_pours)[:1], "gel")
    own = replace(bundle.contract, names=("left", "right"))
    read = contract_from_json(contract_to_json(own))
    assert read == own
    read.check_cameras(CAMERAS)
    with pytest.raises(BadBundle, match="in the order left, right; got right, left"):
        read.check_cameras(CAMERAS[::-1])
    read.check_cameras(tuple(replace(camera, name=f"my {camera.name}") for camera in CAMERAS[::-1]))
    older = contract_from_json(contract_to_json(bundle.contract))
    assert "names" not in contract_to_json(older)
    older.check_cameras(CAMERAS[::-1])


def make(
    folder: Path, pours: list[CameraRecording], features: str
) -> tuple[GraspBundle, list, TrainedHead]:
    name, _, places = features.partition(" ")
    extractor = SlipExtractor(SETTLE) if name == "gel" else open_backbone(name, places=bool(places))
    found = extract(pours, extractor, folder / "cache")
    labels = [(np.arange(len(pour)) > 50).astype(np.int8) for pour in pours]
    config = HeadConfig(frames=4, epochs=1, stride=2, tare="local-size" if places else "change")
    head = fit_head([Track(f.values, f.row, y) for f, y in zip(found, labels, strict=True)], config)
    contract = GraspContract(
        features=name,
        weights="",
        head="lstm",
        frames=4,
        tare=config.tare,
        settle=(SETTLE.start, SETTLE.stop),
        cameras=2,
        width=320,
        height=240,
        rate_hz=60.0,
        rule="gross-slip",
        offset=tuple(tuple(map(float, row)) for row in head.offset),
        factor=tuple(tuple(map(float, row)) for row in head.factor),
        stability=EVER,
        parameters=1,
        data_digest="",
        measured={},
        software="test",
    )
    windows = np.random.default_rng(0).normal(size=(3, 4, 2, extractor.features)).astype("f4")
    model = export_head(head.module, 4, extractor.features)
    import torch

    with torch.inference_mode():
        expected = torch.sigmoid(head.module(torch.from_numpy(windows).flatten(2))).numpy()
    backbone = extractor.model if isinstance(extractor, BackboneExtractor) else None
    write_grasp_bundle(folder / "b.taxel", contract, model, backbone, windows, expected)
    return read_grasp_bundle(folder / "b.taxel"), found, head


@pytest.fixture(scope="module")
def edge(few_pours: Path, tmp_path_factory: pytest.TempPathFactory):
    pours = read_camera_recordings(few_pours)[:2]
    return (*make(tmp_path_factory.mktemp("edge"), pours, "edge"), pours)


@pytest.mark.slow
@pytest.mark.parametrize("features", ["edge", "gel", "mobilenet-v2 places"])
def test_live_equals_offline(few_pours: Path, tmp_path: Path, features: str) -> None:
    """Frame by frame, from JPEG, each window's probability is that of the whole recording."""
    pours = read_camera_recordings(few_pours)[:2]
    bundle, found, head = make(tmp_path, pours, features)
    for pour, own in zip(pours, found, strict=True):
        monitor = GraspMonitor(bundle, pour.cameras)
        answers = [monitor.push(frame_set) for frame_set in frame_sets(pour.path, 2)]
        live = np.array([answer.probability for answer in answers])
        offline = head.probabilities(own.all())
        known = np.isfinite(live)
        assert known.sum() == len(pour) - SETTLE.stop + 1
        np.testing.assert_allclose(live[known], offline[-known.sum() :], atol=1e-5)


def test_live_equals_offline_over_an_outage(edge) -> None:
    """No window joins frames from before and after it: UNKNOWN until enough new ones have come."""
    bundle, found, head, pours = edge
    pour, own = pours[0], found[0]
    kept = np.r_[0:60, 75 : len(pour)]  # a quarter of a second is missing
    sets = [frame_set for n, frame_set in enumerate(frame_sets(pour.path, 2)) if n in set(kept)]
    monitor = GraspMonitor(bundle, pour.cameras)
    answers = [monitor.push(frame_set) for frame_set in sets]
    live = np.array([answer.probability for answer in answers])
    offline = head.judged(replace(own, row=own.row[kept], time_s=own.time_s[kept]))

    assert np.flatnonzero(np.isnan(live[30:])).tolist() == [30, 31, 32]
    np.testing.assert_allclose(live[30:], offline[30 - 3 :], atol=1e-5)
    assert {answer.decision.state for answer in answers[60:63]} == {Stability.UNKNOWN}
    assert np.isfinite(head.judged(own)).all()


def test_nothing_is_reported_before_the_grasp_has_settled(edge) -> None:
    bundle, _, _, pours = edge
    monitor = GraspMonitor(bundle, pours[0].cameras)
    answers = [monitor.push(frame_set) for frame_set in frame_sets(pours[0].path, 2)]
    states = [answer.decision.state for answer in answers]
    assert set(states[: SETTLE.stop - 1]) == {Stability.UNKNOWN}
    assert Stability.UNKNOWN not in states[SETTLE.stop + 3 :]


@pytest.mark.parametrize("fault", ["cut", "empty", "frozen", "late"])
def test_input_that_cannot_be_trusted_is_unknown(edge, fault: str) -> None:
    """A broken, frozen or missing picture never passes for a stable grasp."""
    bundle, _, _, pours = edge
    monitor = GraspMonitor(bundle, pours[0].cameras)
    sets = list(frame_sets(pours[0].path, 2))
    for frame_set in sets[:40]:
        answer = monitor.push(frame_set)
    assert answer.decision.state is not Stability.UNKNOWN
    if fault == "late":
        assert monitor.at(sets[39].time_s + 1.0).state is Stability.UNKNOWN
        return
    state = answer.decision.state
    for frame_set in sets[40:80]:
        left, right = frame_set.frames
        broken = {"cut": right.jpeg[:500], "empty": b"", "frozen": sets[39].frames[1].jpeg}[fault]
        state = monitor.push(FrameSet((left, replace(right, jpeg=broken)))).decision.state
        if fault != "frozen":
            assert state is Stability.UNKNOWN
    assert state is Stability.UNKNOWN


def test_an_image_beside_a_damaged_one_is_looked_at_once_all_are_whole(edge) -> None:
    """A camera that repeats its image then, as 25 Hz in a 60 Hz video, shows it to the model."""
    bundle, _, _, pours = edge
    sets = list(frame_sets(pours[0].path, 2))
    last = next(n for n in range(30, 60) if sets[n].frames[0].jpeg != sets[n - 1].frames[0].jpeg)
    left, right = sets[last].frames
    whole, damaged = (GraspMonitor(bundle, pours[0].cameras) for _ in range(2))
    for frame_set in sets[:last]:
        whole.push(frame_set)
        damaged.push(frame_set)
    doubted = damaged.push(FrameSet((left, replace(right, jpeg=right.jpeg[:500]))))

    assert doubted.decision.state is Stability.UNKNOWN
    assert damaged.push(sets[last]).probability == whole.push(sets[last]).probability


class NoNumber:
    """A network that has gone wrong: whatever it sees, its answer is not a number."""

    def run(self, **_: np.ndarray) -> np.ndarray:
        return np.full(1, np.nan, np.float32)


def test_a_model_that_gives_no_number_is_unknown_with_that_reason(edge) -> None:
    bundle, _, _, pours = edge
    monitor = GraspMonitor(replace(bundle, head=NoNumber()), pours[0].cameras)
    sets = list(frame_sets(pours[0].path, 2))[:60]
    decisions = [monitor.push(frame_set).decision for frame_set in sets]
    assert {decision.state for decision in decisions} == {Stability.UNKNOWN}
    assert decisions[-1].reason == REASONS["nan"].say()


def test_a_new_grasp_starts_afresh(edge) -> None:
    """After a reset the second pour is judged as if it were the first."""
    bundle, _, _, pours = edge
    used, new = (GraspMonitor(bundle, pours[0].cameras) for _ in range(2))
    for frame_set in frame_sets(pours[0].path, 2):
        used.push(frame_set)
    used.reset()
    for frame_set in frame_sets(pours[1].path, 2):
        assert repr(used.push(frame_set).decision) == repr(
            new.push(frame_set).decision
        )  # NaN equals NaN


def test_a_session_counts_grasps_and_outcomes(edge, few_pours: Path) -> None:
    bundle, _, _, pours = edge
    with open_source(f"replay://{pours[0].path}?speed=max") as source:
        tally = run_grasp_session(source, bundle)
    assert tally.moments == len(pours[0])
    assert [grasp["run"] for grasp in tally.grasps] == [pours[0].name]
    assert tally.summary()["frames_without_partner"] == 0


def test_a_session_ends_within_the_frames_that_a_read_gives(edge) -> None:
    """A source without an array gives many frames at once: those of 0.5 s are watched."""
    bundle, _, _, pours = edge
    frames = list(iterate_frames(pours[0].path))
    mark = Mark(start_s=frames[0].fitted_s, end_s=frames[-1].fitted_s, labels={})

    class Once:
        ended = False
        cameras = pours[0].cameras

        def read(self) -> None:
            self.ended = True

        def frames(self) -> list[Frame]:
            return frames

        def marks(self) -> list[Mark]:
            return [mark]

    tally = run_grasp_session(Once(), bundle, seconds=0.5)  # type: ignore[arg-type]
    assert 25 < tally.moments <= 30
    assert tally.grasps == []


def test_another_camera_is_refused(edge) -> None:
    bundle, _, _, pours = edge
    left, right = pours[0].cameras
    for cameras in ((left,), (left, replace(right, width=640)), (left, replace(right, rate_hz=10))):
        with pytest.raises(BadBundle):
            GraspMonitor(bundle, cameras)


def test_a_bundle_whose_backbone_gives_other_features_than_it_says_is_refused(
    edge, tmp_path: Path
) -> None:
    """Places taken for cameras would be averaged without a word."""
    bundle = edge[0]
    windows = np.zeros((1, 4, 2, 64), np.float32)
    head = export_head(edge[2].module, 4, 64)
    expected = open_engine(head).run(features=windows)
    contract = replace(bundle.contract, tare="local-size")
    write_grasp_bundle(
        tmp_path / "b.taxel", contract, head, open_backbone("edge").model, windows, expected
    )
    with pytest.raises(BadBundle, match="a backbone that gives features of shape"):
        read_grasp_bundle(tmp_path / "b.taxel")


def test_a_damaged_bundle_is_refused(edge, tmp_path: Path, few_pours: Path) -> None:
    """Wherever a byte is flipped, the file does not open."""
    make(tmp_path, read_camera_recordings(few_pours)[:1], "gel")
    content = (tmp_path / "b.taxel").read_bytes()
    assert is_grasp_bundle(tmp_path / "b.taxel")
    for at in np.linspace(0, len(content) - 1, 25).astype(int):
        broken = bytearray(content)
        broken[at] ^= 0x10
        (tmp_path / "c.taxel").write_bytes(broken)
        with pytest.raises(BadBundle):
            read_grasp_bundle(tmp_path / "c.taxel")
