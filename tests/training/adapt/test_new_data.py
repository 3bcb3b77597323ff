"""New grasps and sessions are taken for themselves, whatever others are called."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.contract import Contract, fingerprint_of, learned_too
from taxel.errors import BadInput
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.training.adapt.new_data import check_apart, read_grasps
from taxel.training.exemplars import Exemplars, thin_out
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset
from taxel.windows.scaling import fit_scaling

SENSOR = SensorInfo(name="t", channels=tuple("abcd"), units=("V",) * 4, rate_hz=100.0)
ROWS = 24


def record(path: Path, seed: int, session: str = "session-1") -> Path:
    """Three grasps of a ball, four windows each."""
    path.parent.mkdir(exist_ok=True)
    values = np.random.default_rng(seed).random((3 * ROWS, 4)).astype(np.float32)
    with Recorder(path, Manifest.started_now(SENSOR, now_s=0.0)) as recorder:
        recorder.write(Samples.from_values(values, np.arange(len(values)) / 100.0))
        for index in range(3):
            start = index * ROWS / 100.0
            recorder.mark(
                Mark(start_s=start, end_s=start + (ROWS - 1) / 100.0, labels={"shape": "ball"},
                     groups={"session": session})
            )  # fmt: skip
    return path


def contract(data_digest: str = "0" * 64) -> Contract:
    values = np.ones((4, 6, 4), np.float32)
    return Contract(
        target="shape", classes=("a", "b"), window=WindowConfig(steps=6, stride=6),
        scaling=fit_scaling("standard", values, np.ones((4, 6), bool), None),
        channels=SENSOR.channels, units=SENSOR.units, rate_hz=100.0, model="cnn2d", parameters=1,
        data_digest=data_digest, accuracy={}, software="taxel test", parity=None,
    )  # fmt: skip


def test_recordings_of_one_name_keep_their_grasps_and_sessions_apart(tmp_path: Path) -> None:
    paths = [record(tmp_path / day / "rec.mcap", seed) for seed, day in enumerate(("1", "2"))]

    found = read_grasps(paths, contract())

    assert found.count("ball") == 6
    assert len(set(found.session)) == 2
    first = found.first(4)
    assert first.count("ball") == 4
    assert len(first) == 4 * 4


def test_a_session_is_the_trainings_only_where_the_data_are(tmp_path: Path) -> None:
    path = record(tmp_path / "rec.mcap", 0)
    digest = load_dataset(path, contract().window).digest

    other, same = read_grasps([path], contract()), read_grasps([path], contract(digest))

    assert "session-1" not in other.session
    assert set(same.session) == {"session-1"}
    assert same.grasp[0] == "rec#0"


def test_a_folders_recordings_of_one_session_are_one_session(tmp_path: Path) -> None:
    record(tmp_path / "1.mcap", 0)
    record(tmp_path / "2.mcap", 1)

    found = read_grasps([tmp_path], contract())

    assert len(set(found.session)) == 1
    assert found.count("ball") == 6


def test_grasps_of_one_name_in_two_sessions_are_thinned_out_apart() -> None:
    n = 40
    both = Exemplars(
        values=np.zeros((n, 6, 4), np.float32), mask=np.ones((n, 6), bool),
        y=np.zeros(n, np.intp), session=np.repeat(["day1", "day2"], n // 2),
        grasp=np.tile([f"rec#{i}" for i in range(20)], 2),
    )  # fmt: skip

    few = thin_out(both, most=3)

    assert [int((few.session == name).sum()) for name in ("day1", "day2")] == [3, 3]


def test_a_test_set_is_refused_for_the_same_scans_and_for_nothing_else(tmp_path: Path) -> None:
    """Marks without a scan, and trials in which nothing moves, are alike without being copies."""
    learned = record(tmp_path / "learn" / "a.mcap", 0)
    still = []
    for day in "12":
        path = tmp_path / f"still-{day}.mcap"
        with Recorder(path, Manifest.started_now(SENSOR, now_s=0.0)) as recorder:
            recorder.write(Samples.from_values(np.zeros((ROWS, 4)), np.arange(ROWS) / 100.0))
            recorder.mark(Mark(start_s=0.0, end_s=0.1, labels={"shape": "none"}))
            recorder.mark(Mark(start_s=0.113, end_s=0.117, labels={"shape": "none"}))
        still.append(path)

    check_apart([learned, still[0]], still[1])
    check_apart([learned], record(tmp_path / "test" / "a.mcap", 1))
    with pytest.raises(BadInput, match="3 of 3"):
        check_apart([learned], record(tmp_path / "copy.mcap", 0))


def test_only_recordings_that_gave_a_grasp_to_learn_count_as_learned(tmp_path: Path) -> None:
    for seed in range(2):
        record(tmp_path / f"{seed}.mcap", seed)
    known = load_dataset(tmp_path, contract().window).fingerprints

    found = read_grasps([tmp_path], contract()).first(2)
    before = replace(contract(), learned=("f",), learned_groups={"object": ("g",)})
    after = learned_too(before, set(found.recording), b"values")

    assert after.learned == tuple(sorted({"f", fingerprint_of(known["0.mcap"])}))
    assert after.data_digest != contract().data_digest
    assert after.learned_groups == {}  # of which objects, it is not known
    assert learned_too(contract(), set(found.recording), b"values").learned == ()  # as before
