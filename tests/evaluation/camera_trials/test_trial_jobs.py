"""Camera trials on several workers: what they compute is what one process computes."""

from __future__ import annotations

import json
import pickle
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
from trial_makers import as_avi, as_folder, few_small_members, write_trials

import taxel.training.camera_trials.blend as blending
from taxel.bundles.trials import IN_RUN, read_trial_bundle
from taxel.bundles.versions import digest_of
from taxel.cli.evaluation.evaluate_trials import EvaluateTrials
from taxel.cli.main import main
from taxel.cli.options.trials import TrialOptions
from taxel.cli.options.work import WorkOptions
from taxel.cli.training.train_trials import TrainTrials
from taxel.errors import BadBundle, BadDataset, BadInput
from taxel.jobs.call import Call, JobResult, perform
from taxel.jobs.local import LocalEngine
from taxel.jobs.running import use_engine
from taxel.live.whole_trials import predict_side_by_side
from taxel.training.camera_trials.features import TrialRows, all_moves, trial_rows
from taxel.training.camera_trials.image_network import find_image_network
from taxel.training.camera_trials.members import extra, forest, learned
from taxel.training.camera_trials.one_trial import Cuts
from taxel.windows.camera_trials import CameraTrial, read_camera_trials
from taxel.windows.trial_layout import Layout

VIEWS = ("pixels", "stills")


class Posted:
    """An engine that does each job here, after it was made bytes and read again."""

    workers = 2
    logs_each = False
    lost: tuple[type[Exception], ...] = ()

    def __init__(self, cache: Path | None = None) -> None:
        self.done: list[str] = []
        self.elsewhere = cache

    def log(self, line: str) -> None:
        """Forget it."""

    def submit(self, calls: Sequence[Call]) -> list[Future[JobResult]]:
        """Do them in their order; with `elsewhere`, as a worker with a disk of its own."""
        found = []
        for call in calls:
            own: Call = pickle.loads(pickle.dumps(call))
            if self.elsewhere is not None:
                own = Call(work=own.work, args=(*own.args[:-1], self.elsewhere), name=own.name)
            future: Future[JobResult] = Future()
            future.set_result(perform(own))
            self.done.append(call.name)
            found.append(future)
        return found

    def close(self) -> None:
        """Nothing is open."""


def _trials(folder: Path, frames: int = 30) -> list[CameraTrial]:
    table = write_trials(folder, write=as_avi, objects=2, each=2, frames=frames)
    return read_camera_trials(table)


def _same(one_process: TrialRows, workers: TrialRows) -> None:
    for name in one_process.rows:
        np.testing.assert_array_equal(one_process.rows[name], workers.rows[name])
    np.testing.assert_array_equal(one_process.trial, workers.trial)


@pytest.mark.parametrize("moving", [False, True])
def test_workers_leave_in_the_cache_what_one_process_computes(tmp_path: Path, moving: bool) -> None:
    trials, layout = _trials(tmp_path / "a"), Layout(8, 3, moving=moving)
    seen: list[tuple[int, int]] = []

    def on_trial(done: int, of: int) -> None:
        seen.append((done, of))

    for cuts in (Cuts(layout), Cuts(layout, between=2), Cuts(layout, copies=1)):
        seen.clear()
        here = trial_rows(trials, cuts, VIEWS, tmp_path / "here")
        with use_engine(Posted()) as posted:
            there = trial_rows(trials, cuts, VIEWS, tmp_path / "there", on_trial)
            assert seen == [(n, 4) for n in range(1, 5)]
            assert sorted(posted.done) == sorted(trial.name for trial in trials)
            trial_rows(trials, cuts, VIEWS, tmp_path / "there")
            assert len(posted.done) == 4  # all was in the cache
        _same(here, there)


def test_a_recording_and_a_folder_of_images_can_be_sent_to_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a recording by its path, whatever folder the worker is in."""
    write_trials(tmp_path / "a", write=as_folder, objects=2, each=1, frames=12)
    main(["import", str(tmp_path / "a" / "trials.csv"), "--output", str(tmp_path / "rec")])
    monkeypatch.chdir(tmp_path)
    for path in (Path("a/trials.csv"), Path("rec")):
        trials = read_camera_trials(path)
        here = [image for trial in trials for image in trial.read(0)]
        sent = pickle.dumps(trials)
        with monkeypatch.context() as elsewhere:
            elsewhere.chdir("/")
            there = [image for trial in pickle.loads(sent) for image in trial.read(0)]
        assert len(here) == 24
        np.testing.assert_array_equal(here, there)


def test_the_longest_trial_is_the_first(tmp_path: Path) -> None:
    """Begun last, it would keep one worker busy while the others have nothing to do."""
    table = write_trials(tmp_path, write=as_avi, objects=2, each=2, frames=30, shorter=10)
    trials = read_camera_trials(table)
    with use_engine(Posted()) as posted:
        trial_rows(trials, Cuts(Layout(8, 3)), VIEWS, tmp_path / "kept")
    frames = {trial.name: trial.frames for trial in trials}
    assert [frames[name] for name in posted.done] == [30, 30, 20, 20]


def test_a_worker_with_a_cache_of_its_own_is_named(tmp_path: Path) -> None:
    trials = _trials(tmp_path / "a")
    with (
        use_engine(Posted(tmp_path / "other")),
        pytest.raises(BadInput, match=r"one cache for all workers.*a shared disk with --cache"),
    ):
        trial_rows(trials, Cuts(Layout(8, 3)), VIEWS, tmp_path / "kept")


@pytest.mark.parametrize("imported", [False, True])
def test_a_worker_refuses_images_that_are_not_those_of_the_command(
    tmp_path: Path, imported: bool
) -> None:
    """Else the cache would keep what it saw as what the command asked for."""
    table = write_trials(tmp_path / "a", objects=2, each=1, frames=12)
    other = write_trials(tmp_path / "b", objects=2, each=1, frames=12, first=9)
    if imported:
        for given, to in ((table, "rec"), (other, "other")):
            main(["import", str(given), "--output", str(tmp_path / to)])
        trials = read_camera_trials(tmp_path / "rec")
        changed = sorted((tmp_path / "other").glob("*.mcap"))[0]
    else:
        trials, changed = read_camera_trials(table), tmp_path / "b" / "t0c0.avi"
    kept = (tmp_path / ("rec" if imported else "a")) / changed.name
    kept.write_bytes(changed.read_bytes())
    with use_engine(Posted()):
        with pytest.raises(BadDataset, match="as they were when"):
            trial_rows(trials, Cuts(Layout(8, 3)), VIEWS, tmp_path / "kept")
        with pytest.raises(BadDataset, match="as they were when"):
            all_moves(trials, Layout(8, 3, moving=True), tmp_path / "kept")


def test_a_damaged_file_of_the_cache_is_computed_again(tmp_path: Path) -> None:
    trials, cuts = _trials(tmp_path / "a"), Cuts(Layout(8, 3))
    with use_engine(Posted()):
        first = trial_rows(trials, cuts, VIEWS, tmp_path / "kept")
        for file in (tmp_path / "kept").rglob("*.npy"):
            file.write_bytes(file.read_bytes()[:100])
        _same(first, trial_rows(trials, cuts, VIEWS, tmp_path / "kept"))


@pytest.mark.parametrize("engine", [False, True])
def test_whether_all_frames_count_is_asked_until_one_trial_says_no(
    tmp_path: Path, engine: bool
) -> None:
    trials, seen = _trials(tmp_path / "a", frames=60), list[tuple[int, int]]()
    ask = (trials, Layout(8, 3, moving=True), tmp_path / "kept", lambda *at: seen.append(at))
    whole = (trials, Layout(60, 1), tmp_path / "kept", lambda *at: seen.append(at))
    if engine:
        with use_engine(Posted()):
            found, all_of_them = all_moves(*ask), all_moves(*whole)
    else:
        found, all_of_them = all_moves(*ask), all_moves(*whole)
    assert not found
    assert all_of_them
    assert seen[-4:] == [(n, 4) for n in range(1, 5)]


@pytest.mark.parametrize("make", [forest, lambda seed, trees: extra(seed, trees, 9)])
def test_trees_that_grow_side_by_side_are_those_that_grow_one_by_one(make: object) -> None:
    assert callable(make)
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(60, 9)).astype(np.float32)
    y = (rows[:, 0] > 0).astype(np.intp)
    alone = learned(make(0, 20), rows, y)
    with use_engine(Posted()):
        beside = learned(make(0, 20), rows, y)
    assert beside.n_jobs == alone.n_jobs == 1
    np.testing.assert_array_equal(alone.predict_proba(rows), beside.predict_proba(rows))


@pytest.mark.slow
def test_the_command_prints_the_same_whatever_the_number_of_workers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With real processes."""
    few_small_members(monkeypatch)
    monkeypatch.setattr(blending, "MEMBERS", blending.MEMBERS[:2])
    table = write_trials(tmp_path, write=as_avi, objects=4, each=2, frames=14, shorter=2)
    printed = []
    for workers in (1, 2):
        options = TrialOptions(
            cache=tmp_path / f"kept-{workers}", split="group:object", fold_count=2, crop=8,
            network=False,
            work=WorkOptions(workers=workers),
        )  # fmt: skip
        EvaluateTrials(trials=table, json=True, options=options).run()
        printed.append(json.loads(capsys.readouterr().out))
    assert printed[0] == printed[1]
    names = [
        sorted(str(file.relative_to(kept)) for file in kept.rglob("*.npy"))
        for kept in (tmp_path / "kept-1", tmp_path / "kept-2")
    ]
    assert names[0] == names[1]
    assert len(names[0]) > 0


@pytest.mark.slow
def test_a_bundle_is_scored_alike_by_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its file is named to them, and a trial that is too short has its place."""
    few_small_members(monkeypatch)
    monkeypatch.setattr(blending, "MEMBERS", blending.MEMBERS[:2])
    table = write_trials(tmp_path / "a", objects=4, each=2, frames=14, shorter=2)
    options = TrialOptions(cache=tmp_path / "kept", crop=8, network=False)
    TrainTrials(trials=table, output=tmp_path / "run", options=options, check=False).run()
    short = write_trials(tmp_path / "b", objects=1, each=1, frames=7)
    trials = [*read_camera_trials(short), *read_camera_trials(table)]
    file = tmp_path / "run" / IN_RUN
    bundle, seen = read_trial_bundle(file), list[tuple[int, int]]()
    named = file, digest_of(file)
    here = predict_side_by_side(bundle, named, trials)
    with use_engine(Posted()) as posted:
        there = predict_side_by_side(bundle, named, trials, lambda *at: seen.append(at))
    assert len(posted.done) == len(here) == len(there) == 9
    assert seen == [(n, 9) for n in range(1, 10)]
    assert here[0].reason == there[0].reason == "7 frames, fewer than a crop"
    for own, other in zip(here, there, strict=True):
        assert own.label == other.label
        np.testing.assert_array_equal(own.probabilities, other.probabilities)
    with use_engine(Posted()), pytest.raises(BadBundle, match="as it was when the command began"):
        predict_side_by_side(bundle, (file, "0" * 64), trials)
    other = write_trials(tmp_path / "c", objects=1, each=1, frames=14, first=9)
    (tmp_path / "a" / "t0c0.avi").write_bytes((other.parent / "t0c0.avi").read_bytes())
    with use_engine(Posted()), pytest.raises(BadDataset, match="as they were when"):
        predict_side_by_side(bundle, named, trials)


@pytest.mark.slow
def test_workers_look_through_the_same_network(tmp_path: Path) -> None:
    trials, network = _trials(tmp_path / "a"), find_image_network()
    assert network is not None
    cuts = Cuts(Layout(8, 3), network=network)
    here = trial_rows(trials, cuts, ("network",), tmp_path / "here")
    with use_engine(LocalEngine(2)):
        there = trial_rows(trials, cuts, ("network",), tmp_path / "there")
    _same(here, there)
