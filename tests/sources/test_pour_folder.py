"""Claims about sets of simulated pours: whole or unfinished, and never simulated twice."""

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine
from taxel.recordings.reader import iterate_frames, read_recording
from taxel.sim.pour.cup_pour import CupPourConfig
from taxel.sources.simulated import pour_folder
from taxel.sources.simulated.pour_folder import unfinished_folder, write_pours

SET = CupPourConfig(
    cups=2, positions=("middle",), forces_n=(15.0, 50.0), duration_s=1.0, frame_hz=20.0
)


class Broken(Exception):
    """The run was broken off."""


def content(folder: Path) -> dict[str, Any]:
    """Return what each recording holds, but for when it was made."""
    found = {}
    for path in sorted(folder.iterdir()):
        whole = read_recording(path)
        images = [(frame.camera, frame.counter, frame.jpeg) for frame in iterate_frames(path)]
        found[path.name] = (whole.samples.values.tobytes(), repr(whole.marks), images)
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, Any]]]:
    """The set as an unbroken run in this process gives it."""
    folder = tmp_path_factory.mktemp("whole") / "set"
    return folder, write_pours(folder, SET, workers=1)


@pytest.mark.slow
def test_a_broken_run_keeps_what_is_whole_and_the_next_goes_on(
    whole: tuple[Path, list[dict[str, Any]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, done = tmp_path / "set", []

    def break_off(row: dict[str, Any]) -> None:
        done.append(row["run"])
        if len(done) == 3:
            raise Broken

    with pytest.raises(Broken):
        write_pours(output, SET, break_off, workers=1)
    assert not output.exists()
    simulated: list[str] = []
    simulate = pour_folder.write_run
    monkeypatch.setattr(
        pour_folder, "write_run",
        lambda folder, run, *more: simulated.append(run.name) or simulate(folder, run, *more),
    )  # fmt: skip
    rows = write_pours(output, SET, workers=1)

    assert len(simulated) == 1
    assert not set(simulated) & set(done)
    assert rows == whole[1]
    assert content(output) == content(whole[0])
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


@pytest.mark.slow
@pytest.mark.parametrize("damage", [lambda whole: whole[:-1], lambda whole: bytes(len(whole))])
def test_a_recording_that_is_damaged_or_of_another_set_is_made_again(
    whole: tuple[Path, list[dict[str, Any]]], tmp_path: Path, damage: Callable[[bytes], bytes]
) -> None:
    """Also one of the same length: a power cut may leave zeros in a file's place."""
    output = tmp_path / "set"
    other = replace(SET, seed=1)

    def stop(_: dict[str, Any]) -> None:
        raise Broken

    for config in (other, SET):
        with pytest.raises(Broken):
            write_pours(output, config, stop, workers=1)
    for path in (unfinished_folder(output) / "made").iterdir():
        path.write_bytes(damage(path.read_bytes()))
    assert write_pours(output, SET, workers=1) == whole[1]
    assert content(output) == content(whole[0])


def test_a_set_of_which_no_run_is_whole_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise Broken

    monkeypatch.setattr(pour_folder, "write_run", refuse)
    with pytest.raises(Broken):
        write_pours(tmp_path / "set", SET, workers=1)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_there_is_not_written_to(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="a folder that does not exist yet"):
        write_pours(tmp_path, SET, workers=1)


@pytest.mark.slow
def test_a_worker_killed_midway_changes_nothing(
    whole: tuple[Path, list[dict[str, Any]]], tmp_path: Path
) -> None:
    lines: list[str] = []
    killed: list[int] = []

    def kill_a_worker(_: dict[str, Any]) -> None:
        if not killed:
            pid = active_children()[0].pid
            assert pid is not None
            killed.append(pid)
            os.kill(pid, signal.SIGKILL)

    with use_engine(LocalEngine(2, lines.append)):
        rows = write_pours(tmp_path / "set", SET, kill_a_worker)

    assert rows == whole[1]
    assert content(tmp_path / "set") == content(whole[0])
    assert np.all([f"worker {killed[0]} was killed by SIGKILL" in line for line in lines])
