"""Reference touches bring sessions to one level."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.contract import at_level, contract_from_json, contract_to_json
from taxel.errors import BadBundle, BadDataset, BadInput
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.training.run import contract_of
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset
from taxel.windows.recut import recut
from taxel.windows.reference import parse_reference, touch_level, usual_of
from taxel.windows.scaling import fit_scaling

GAINS = {"a": np.array([1.0, 2.0, 0.0]), "b": np.array([3.0, 0.5, 0.0])}
WINDOW = WindowConfig(steps=4, stride=4, grid_hz=None, reference="object=block:2")


def recorded(
    folder: Path, name: str, gain: np.ndarray, session: str = "", first_s: float = 0.0
) -> None:
    """Write a session: a ball and three blocks, eight scans each."""
    sensor = SensorInfo(name="pad", channels=("x", "y", "z"), units=("V",) * 3, rate_hz=100.0)
    course = np.tile([0.5, 1.0, 0.7, 0.2], 2)[:, None]
    manifest = Manifest.started_now(sensor, groups={"session": session or name}, now_s=0.0)
    with Recorder(folder / f"{name}.mcap", manifest) as recorder:
        for index, touched in enumerate(["ball", "block", "block", "block"]):
            own = course * (gain if touched == "block" else 0.5 * gain)
            time_s = first_s + (index * 10 + np.arange(8)) / 100.0
            recorder.write(Samples.from_values(own, time_s))
            recorder.mark(
                Mark(
                    start_s=float(time_s[0]),
                    end_s=float(time_s[-1]),
                    labels={"kind": touched},
                    groups={"object": touched},
                )
            )


@pytest.fixture
def sessions(tmp_path: Path) -> Path:
    """Two sessions whose channels differ in gain only; four trials of eight scans each."""
    for name, gain in GAINS.items():
        recorded(tmp_path, name, gain)
    return tmp_path


def test_a_sessions_first_touches_are_those_of_the_recording_that_people_count_first(
    tmp_path: Path,
):
    """cup_2 before cup_10: the latter's gain is not the session's level."""
    for number, gain in ((10, 4.0), (2, 1.0)):
        recorded(tmp_path, f"cup_{number}", gain * GAINS["a"], session="s")
    dataset = load_dataset(tmp_path, WINDOW)
    left = [(trial.recording, trial.labels["kind"]) for trial in dataset.trials]

    assert left.count(("cup_2.mcap", "block")) == 1
    assert left.count(("cup_10.mcap", "block")) == 3


def test_sessions_that_differ_in_gain_alone_become_one(sessions: Path):
    dataset = load_dataset(sessions, WINDOW)
    names = dataset.group("session")[dataset.trial]
    first, second = (dataset.windows.values[names == name] for name in GAINS)
    np.testing.assert_allclose(first, second, rtol=1e-5)
    assert first.std(axis=1)[:, :2].min() > 0


def test_touches_that_set_the_level_are_neither_learned_from_nor_tested(sessions: Path):
    dataset = load_dataset(sessions, WINDOW)
    assert [trial.labels["kind"] for trial in dataset.trials] == ["ball", "block"] * 2
    assert dataset.trials[1].start_s == pytest.approx(0.3), "the first two blocks are left out"
    assert "object=block:2" in dataset.notes[-1]


def test_a_silent_channel_stays_as_it_is(sessions: Path):
    dataset = load_dataset(sessions, WINDOW)
    assert dataset.reference is not None
    assert dataset.reference.level[2] == 1.0
    assert not dataset.windows.values[:, :, 2].any()


def test_a_session_with_too_few_touches_is_reported(sessions: Path):
    with pytest.raises(BadDataset, match=r"needed 4 touches of object=block .* got 3 in a"):
        load_dataset(sessions, replace(WINDOW, reference="object=block:4"))


@pytest.mark.parametrize("text", ["object", "object=block", "=block:3", "object=block:0", "a=b:c"])
def test_a_reference_that_names_no_touches_is_reported(text: str):
    with pytest.raises(BadInput, match="KEY=VALUE:COUNT"):
        parse_reference(text)


def test_a_contract_brought_to_a_session_sees_in_it_what_training_saw(sessions: Path):
    dataset = load_dataset(sessions, WINDOW)
    windows = dataset.windows
    scaling = fit_scaling("standard", windows.values, windows.mask, None)
    contract = contract_of(dataset, "kind", "cnn2d", (), scaling, {})
    contract = contract_from_json(contract_to_json(contract))
    plain = load_dataset(sessions, replace(WINDOW, reference=None))
    in_b = plain.group("session")[plain.trial] == "b"
    block = np.array([trial.labels["kind"] == "block" for trial in plain.trials])[plain.trial]
    touches = plain.windows[in_b & block][:4]
    level = touch_level(touches.values, touches.mask)
    moved = at_level(contract, level)
    seen = moved.scaling.apply(plain.windows[in_b].values[-2:], plain.windows[in_b].mask[-2:])
    wanted = scaling.apply(windows.values[-2:], windows.mask[-2:])
    np.testing.assert_allclose(seen, wanted, rtol=1e-4, atol=1e-5)
    assert moved.reference is not None
    np.testing.assert_array_equal(moved.reference.level[:2], level[:2])
    assert moved.reference.level[2] == 1.0, "a silent channel keeps its level"


def test_a_bundle_without_reference_cannot_be_brought_to_a_session(sessions: Path):
    dataset = load_dataset(sessions, replace(WINDOW, reference=None))
    scaling = fit_scaling("none", dataset.windows.values, dataset.windows.mask, None)
    contract = contract_of(dataset, "kind", "cnn2d", (), scaling, {})
    with pytest.raises(BadBundle, match="without"):
        at_level(contract, np.ones(3, np.float32))


def test_a_channel_silent_in_one_session_leaves_the_others_alone(sessions: Path):
    """Session c is a with channel y dead in its touches."""
    recorded(sessions, "c", np.array([1.0, 0.0, 0.0]))
    dataset = load_dataset(sessions, WINDOW)
    assert dataset.reference is not None
    rms = np.sqrt(np.mean(np.square([0.5, 1.0, 0.7, 0.2])))
    assert dataset.reference.level[1] == pytest.approx(rms * np.sqrt(2.0 * 0.5)), "of a and b"
    assert dataset.to_level is not None
    in_c = dataset.group("session") == "c"
    np.testing.assert_array_equal(dataset.to_level[in_c][:, 1], 1.0)


def test_a_session_counts_once_in_the_usual_level_however_many_trials_it_has():
    """Also where a channel of it was silent, whose level is NaN in each of its trials."""
    silent, other = np.float32([[1.0, np.nan]]), np.float32([[4.0, 3.0]])

    usual = usual_of(np.concatenate([silent] * 50 + [other]))

    np.testing.assert_allclose(usual, [2.0, 3.0], rtol=1e-6)  # of 1 and 4; of 3 alone


def test_windows_cut_again_stand_at_the_level_of_the_first_cut(sessions: Path):
    dataset = load_dataset(sessions, WINDOW)
    again = recut(sessions, dataset, 1, 4)
    assert len(again) > len(dataset)
    found = dict(
        zip(zip(again.trial, again.windows.start_s, strict=True), again.windows.values, strict=True)
    )
    for owner, start_s, values in zip(
        dataset.trial, dataset.windows.start_s, dataset.windows.values, strict=True
    ):
        np.testing.assert_allclose(found[owner, start_s], values, rtol=1e-6)


def test_touches_of_a_session_in_two_files_are_taken_file_by_file(tmp_path: Path):
    """The second file's clock starts anew: its touches are not the session's first."""
    recorded(tmp_path, "day-1", np.array([1.0, 1.0, 1.0]), session="day", first_s=50.0)
    recorded(tmp_path, "day-2", np.array([2.0, 2.0, 2.0]), session="day")
    dataset = load_dataset(tmp_path, WINDOW)
    left = [(trial.recording, trial.labels["kind"]) for trial in dataset.trials]
    assert left.count(("day-1.mcap", "block")) == 1
    assert left.count(("day-2.mcap", "block")) == 3


def test_a_quiet_channel_beside_loud_ones_has_a_level_of_its_own(tmp_path: Path):
    """As of another unit: x is a thousand times y, and y differs by two between sessions."""
    recorded(tmp_path, "a", np.array([1000.0, 1.0, 100.0]))
    recorded(tmp_path, "b", np.array([1000.0, 2.0, 100.0]))
    dataset = load_dataset(tmp_path, WINDOW)
    assert dataset.to_level is not None
    wanted = np.array([[1.0, np.sqrt(2.0), 1.0], [1.0, np.sqrt(0.5), 1.0]])
    np.testing.assert_allclose(dataset.to_level, wanted.repeat(2, axis=0), rtol=1e-5)
