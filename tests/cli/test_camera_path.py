"""The camera's main path: simulate, label, train, bundle, replay as offline, alarm.

Once for the gel monitor and once for a backbone, the smallest that there is, over six pours.
"""

import io
import json
import re
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.bundles.grasp import GraspBundle, read_grasp_bundle
from taxel.cli.main import main
from taxel.decisions.stability import Stability, states
from taxel.live.grasp_monitor import GraspAnswer
from taxel.live.grasp_session import run_grasp_session
from taxel.sources.opening import open_source
from taxel.training.frames.extractors import SlipExtractor, open_backbone
from taxel.training.frames.features import extract
from taxel.windows.camera_recordings import CameraRecording, read_camera_recording
from taxel.windows.rest import SETTLE, seen, settled
from taxel.windows.sequence import sequence_windows

pytestmark = pytest.mark.slow
FALLS, STILL = "cup-01_upper_15N", "cup-01_middle_15N_still"
"""A cup that slips and falls, and one into which nobody pours."""


def printed(*words: object) -> Any:
    """Run a command and return the JSON that it prints."""
    with redirect_stdout(io.StringIO()) as out:
        main([*map(str, words), "--json"])
    return json.loads(out.getvalue())


@dataclass(frozen=True)
class World:
    """Recordings on disk, and what the simulator says of each."""

    folder: Path
    truth: dict[str, dict[str, Any]]

    def recording(self, name: str) -> Path:
        return self.folder / "cups" / f"{name}.mcap"


@dataclass(frozen=True)
class Learnt:
    """A monitor that was trained on them."""

    features: str
    path: Path
    printed: dict[str, Any]
    bundle: GraspBundle


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """Two cups at three positions under 15 N."""
    folder = tmp_path_factory.mktemp("camera")
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("TAXEL_CACHE", str(folder / "cache"))
        rows = printed("simulate", "cup-pour", "--output", folder / "cups", "--cups", 2,
                       "--forces-n", 15, "--duration-s", 3)  # fmt: skip
        yield World(folder, {row["run"]: row for row in rows})


@pytest.fixture(scope="module", params=["gel", "edge"])
def learnt(world: World, request: pytest.FixtureRequest) -> Learnt:
    path = world.folder / f"{request.param}.taxel"
    found = printed("train-monitor", world.folder / "cups", "--features", request.param,
                    "--rule", "gross-slip", "--output", path)  # fmt: skip
    return Learnt(request.param, path, found, read_grasp_bundle(path))


def test_labels_are_the_simulator_s_truth(world: World) -> None:
    found = printed("label", world.folder / "cups", "--rule", "gross-slip")
    onsets = {Path(row["recording"]).stem: row["onset_s"] for row in found["recordings"]}

    assert onsets == {name: row["gross_slip_s"] for name, row in world.truth.items()}
    assert onsets[STILL] is None
    assert sum(onset is not None for onset in onsets.values()) == 4


def test_the_bundle_says_what_it_was_trained_on_and_what_it_is_worth(learnt: Learnt) -> None:
    contract = learnt.bundle.contract

    assert (contract.rule, contract.features, contract.frames, contract.cameras) == (
        "gross-slip", learnt.features, 8, 2,
    )  # fmt: skip
    assert contract.rate_hz == pytest.approx(60.0, abs=0.1)
    assert contract.settle == (SETTLE.start, SETTLE.stop)
    assert learnt.printed["measured"] == contract.measured
    assert set(contract.measured) == {
        "balanced accuracy", "AUC", "median lead (s)", "missed", "false alarms a minute",
    }  # fmt: skip
    assert learnt.printed["parity"] < 1e-5
    assert learnt.printed["parameters"] == contract.parameters
    if learnt.features == "gel":
        assert contract.measured["AUC"] > 0.6  # what the surface does is seen from two cups alone


def offline(learnt: Learnt, pour: CameraRecording, cache: Path) -> np.ndarray:
    """Return the probability at each window's end, from features of the whole recording."""
    extractor = SlipExtractor(SETTLE) if learnt.features == "gel" else open_backbone("edge")
    (found,) = extract([pour], extractor, cache)
    features, contract = found.all(), learnt.bundle.contract
    change = seen(features, settled(features[SETTLE]), contract.tare)
    windows = sequence_windows(
        (change - learnt.bundle.offset) * learnt.bundle.factor, contract.frames
    )
    return np.array([learnt.bundle.probability(window) for window in windows])


@pytest.mark.parametrize("name", [FALLS, STILL])
def test_a_replay_gives_what_was_computed_offline(
    world: World, learnt: Learnt, name: str, tmp_path: Path
) -> None:
    """Probabilities frame by frame and the states that follow, decoded and paired anew."""
    pour = read_camera_recording(world.recording(name))
    answers: list[GraspAnswer] = []
    with open_source(f"replay://{pour.path}?speed=max") as source:
        run_grasp_session(source, learnt.bundle, on_answer=lambda a, _: answers.append(a))
    *answers, last = answers
    live = np.array([answer.probability for answer in answers])
    known = np.flatnonzero(np.isfinite(live))
    expected = offline(learnt, pour, tmp_path)[-len(known) :]

    assert last.decision.state is Stability.NO_GRASP  # behind the mark of the grasp's end
    assert len(answers) == len(pour) == 180
    assert known[0] == SETTLE.stop - 1
    assert len(known) == 180 - known[0]
    np.testing.assert_allclose(live[known], expected, atol=1e-5)
    expected_states = states(expected, pour.time_s[known], learnt.bundle.contract.stability)
    assert [Stability(state) for state in expected_states] == [
        answers[i].decision.state for i in known
    ]


def test_the_alarm_is_raised_for_the_cup_that_falls_and_for_no_still_one(
    world: World, learnt: Learnt
) -> None:
    for name in (FALLS, STILL):
        found = printed("live", learnt.path, f"replay://{world.recording(name)}?speed=max")
        (grasp,) = found["grasps"]
        truth = world.truth[name]
        assert (grasp["run"], grasp["outcome"]) == (name, truth["outcome"])
        assert found["moments"] == 180
        assert found["frames_without_partner"] == 0
        if name == STILL:
            assert (found["alarms"], grasp["first_alarm_s"]) == (0, None)
            continue
        assert found["alarms"] == 1
        assert truth["start_s"] < grasp["first_alarm_s"] < truth["gross_slip_s"] + 0.3


def test_a_person_reads_each_change_of_state_and_what_came_of_the_grasp(
    world: World, learnt: Learnt
) -> None:
    with redirect_stdout(io.StringIO()) as out:
        main(["live", str(learnt.path), f"replay://{world.recording(FALLS)}?speed=max"])
    text = out.getvalue()
    words = re.findall(r"^ +\d+\.\d\d s  ([A-Z]+(?: GRASP)?)", text, re.MULTILINE)

    assert words[0] == "UNKNOWN"
    assert "P(" in text
    assert "STABLE" in words
    assert words[-2] in ("WARNING", "UNSTABLE")
    assert words[-1] == "NO GRASP"
    assert "180 moments: " in text
    assert "; 1 alarm\n" in text
    assert f"  {FALLS}: drop, first alarm after " in text
    assert "frames to decision: median " in text


def test_a_person_reads_that_nothing_was_warned_of(world: World, learnt: Learnt) -> None:
    with redirect_stdout(io.StringIO()) as out:
        main(["live", str(learnt.path), f"replay://{world.recording(STILL)}?speed=max"])
    text = out.getvalue()

    assert "WARNING" not in text
    assert "UNSTABLE" not in text
    assert f"  {STILL}: hold, no alarm" in text
