"""Recordings of grasps watched one after another: the very states of the live session."""

from pathlib import Path

import pytest

from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import DEFAULT_WARNING, shipped_bundle
from taxel.decisions.stability import Stability
from taxel.errors import BadBundle
from taxel.live.grasp_session import run_grasp_session
from taxel.live.whole_grasps import watch_grasps
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.sources.opening import open_source


@pytest.fixture(scope="module")
def two_grasps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One recording of two cups, each with its outcome."""
    path = tmp_path_factory.mktemp("pours") / "two.mcap"
    with open_source("sim://cup-pour?runs=2&duration_s=2&seed=4&kind=still&speed=max") as source:
        manifest = Manifest.started_now(source.info, {}, cameras=source.cameras)
        with Recorder(path, manifest) as recorder:
            while not source.ended:
                samples = source.read(0.005)
                if len(samples):
                    recorder.write(samples)
                for frame in source.frames():
                    recorder.frame(frame)
                for mark in source.marks():
                    recorder.mark(mark)
    return path


def test_each_grasp_has_the_states_that_the_live_session_gave(two_grasps: Path):
    bundle = shipped_bundle(DEFAULT_WARNING)
    live: list[tuple[float, str]] = []
    with open_source(f"replay://{two_grasps}?speed=max") as source:
        run_grasp_session(
            source, read_grasp_bundle(bundle),
            on_answer=lambda answer, _: live.append(
                (answer.time_s, answer.decision.state.name)
            ),
        )  # fmt: skip
    tracks = watch_grasps(bundle, two_grasps)
    watched = [
        (float(time_s), Stability(state).name)
        for track in tracks
        for time_s, state in zip(track.time_s, track.states, strict=True)
    ]

    assert len(tracks) == 2
    assert all(track.labels["outcome"] == "hold" for track in tracks)
    assert [state for _, state in watched] == [
        state for _, state in live if state != Stability.NO_GRASP.name
    ]
    assert {"STABLE", "UNKNOWN"} == {state for _, state in watched}


def test_a_recording_without_such_cameras_is_named(tmp_path: Path):
    """Of a folder of many it was said only that one has none."""
    path = tmp_path / "hand.mcap"
    with open_source("sim://teng?speed=max") as source:
        Recorder(path, Manifest.started_now(source.info, {})).close()
    with pytest.raises(BadBundle, match=r"got one with 0: .*hand\.mcap"):
        watch_grasps(shipped_bundle(DEFAULT_WARNING), path)
