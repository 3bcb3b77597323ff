"""The live path sees the windows and gives the answers that training and evaluation saw."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import write_bundle
from taxel.clock import ManualClock
from taxel.live.recogniser import Recogniser
from taxel.live.session import run_session
from taxel.models.catalogue import find_network
from taxel.recordings.reader import read_recording
from taxel.signals import Samples
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.opening import open_source
from taxel.sources.simulated.data_sets import write_sessions
from taxel.training.loop import new_network, predict
from taxel.training.run import contract_of
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.dataset import load_dataset
from taxel.windows.scaling import fit_scaling
from taxel.windows.windower import Windows, cut_windows

WINDOWS = {
    "TENG": TENG_WINDOW,
    "padded and tared": replace(TENG_WINDOW, steps=30, stride=30, pad=True, tare=True),
    "without a gate": WindowConfig(steps=20, stride=10),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One session at 1 kHz, so that the grid has work to do."""
    folder = tmp_path_factory.mktemp("live") / "set"
    config = TengHandConfig(rate_hz=1000.0, scans_per_class=12_000, sessions=1)
    write_sessions(folder, config, lambda _: None)
    return folder


def bundle_for(folder: Path, window: WindowConfig, path: Path):
    dataset = load_dataset(folder, window, target="shape")
    windows = dataset.windows
    network = new_network(lambda: find_network("cnn2d").build(window.steps, 12, 3), 0)
    scaling = fit_scaling("full-scale", windows.values, windows.mask, dataset.sensor.full_scale)
    contract = contract_of(dataset, "shape", "cnn2d", (network,), scaling, {})
    write_bundle(path, (network,), contract, windows.values, windows.mask)
    return network, scaling


@pytest.mark.parametrize("name", WINDOWS)
def test_a_replay_gives_the_windows_and_probabilities_of_the_recording(
    name: str, folder: Path, tmp_path: Path
) -> None:
    window, file = WINDOWS[name], folder / "session-1.mcap"
    network, scaling = bundle_for(folder, window, tmp_path / "b.taxel")
    recording = read_recording(file)
    whole = cut_windows(recording.samples, window, recording.manifest.sensor)
    scaled = scaling.apply(whole.values, whole.mask)
    expected = predict(network, scaled, whole.mask)

    answers = []
    with open_source(f"replay://{file}?speed=max", ManualClock()) as source:
        recogniser = Recogniser(read_bundle(tmp_path / "b.taxel"), source.info)
        while not source.ended:
            answers += recogniser.push(source.read())
        answers += recogniser.flush()

    live = Windows.join([answer.window for answer in answers])
    np.testing.assert_array_equal(live.values, whole.values)
    np.testing.assert_array_equal(live.mask, whole.mask)
    shift = live.start_s - whole.start_s
    np.testing.assert_allclose(shift, shift[0], atol=1e-6)
    probabilities = [answer.decision.probabilities for answer in answers]
    np.testing.assert_allclose(probabilities, expected, atol=1e-5)


def test_a_simulated_source_gives_the_windows_of_its_samples() -> None:
    windows, parts = [], []
    url = "sim://teng?speed=max&seconds=15&seed=3"
    with open_source(url, ManualClock()) as source:
        from taxel.windows.windower import Windower

        windower = Windower(TENG_WINDOW, source.info)
        while not source.ended:
            parts.append(source.read())
            windows.append(windower.push(parts[-1]))
        windows.append(windower.flush())
        whole = cut_windows(Samples.join(parts), TENG_WINDOW, source.info)

    live = Windows.join(windows)
    assert len(live) > 5
    np.testing.assert_array_equal(live.values, whole.values)
    np.testing.assert_array_equal(live.start_s, whole.start_s)


def test_a_session_counts_every_window_and_compares_it_with_the_marks(
    folder: Path, tmp_path: Path
) -> None:
    bundle_for(folder, TENG_WINDOW, tmp_path / "b.taxel")
    dataset = load_dataset(folder, TENG_WINDOW, target="shape")
    with open_source(f"replay://{folder}/session-1.mcap?speed=max", ManualClock()) as source:
        (tally,) = run_session(source, [Recogniser(read_bundle(tmp_path / "b.taxel"), source.info)])

    assert tally.windows >= tally.marked == len(dataset)
    assert sum(tally.answers.values()) == tally.windows
    assert tally.grasps == len(dataset.trials)


def test_a_session_ends_after_its_seconds() -> None:
    with open_source("sim://teng?speed=max", ManualClock()) as source:
        assert run_session(source, [], seconds=3.0) == []


def test_the_live_path_loads_no_training_framework(folder: Path, tmp_path: Path) -> None:
    bundle_for(folder, TENG_WINDOW, tmp_path / "b.taxel")
    code = (
        "import sys; from taxel.cli.main import main\n"
        f"main(['live', {str(tmp_path / 'b.taxel')!r},"
        f" 'replay://{folder}/session-1.mcap?speed=max', '--json'])\n"
        "heavy = {'torch', 'sklearn', 'aeon', 'onnx', 'matplotlib', 'scipy', 'safetensors'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stderr
    assert '"windows"' in done.stdout
