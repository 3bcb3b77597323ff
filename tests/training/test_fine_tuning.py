"""Claims about training end to end: it learns, keeps normalisation, and shares windows out."""

import json
import subprocess
import sys
from copy import deepcopy
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import torch
from forked import Forked, Started

from taxel.bench.real_mosquitto import free_port
from taxel.cli.main import main
from taxel.evaluation.transitions.data import load_camera_set
from taxel.frame_codec import decode_jpeg
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.weights import find_weights
from taxel.training.backbones import lanes as lanes_module
from taxel.training.backbones.fine_tuning import EndToEnd, FineTuneConfig, KeptEpochs, fine_tune
from taxel.training.backbones.lanes import LANES, Lanes
from taxel.training.frames.extractors import open_backbone
from taxel.training.frames.features import extract
from taxel.training.frames.heads import HeadConfig, TrainedHead, fit_head, tracks_of
from taxel.windows.camera_recordings import frame_sets, read_camera_recordings
from taxel.windows.sequence import window_starts

EDGE = "edge"
K, STRIDE = 3, 30
CONFIG = FineTuneConfig(seed=5)
if find_spec("lightning_fabric") is None:
    pytest.skip(
        "lightning-fabric is not installed: pip install 'taxel[fine-tune]'", allow_module_level=True
    )


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Features of the pours, computed once for all that begin with them."""
    return tmp_path_factory.mktemp("cache")


def learnt_head(folder: Path, cache: Path) -> TrainedHead:
    pours = load_camera_set(folder, "change", cache)
    features = extract(pours.pours, open_backbone(EDGE), cache)
    config = HeadConfig(frames=K, epochs=1, tare="size")
    return fit_head(tracks_of(features, pours.labels), config)


def network(head: TrainedHead) -> EndToEnd:
    module = find_backbone(EDGE).build("logits")
    find_weights(EDGE).load_into(module)
    return EndToEnd(module, EDGE, head).eval()


@pytest.mark.slow
def test_training_lowers_the_loss_and_leaves_normalisation_as_it_was(
    few_pours: Path, cache: Path
) -> None:
    pours = load_camera_set(few_pours, "change", cache)
    tuned = network(learnt_head(few_pours, cache))
    before = {name: value.clone() for name, value in tuned.state_dict().items()}
    config = FineTuneConfig(epochs=4, learning_rate=1e-3, accelerator="cpu")

    done = fine_tune(tuned, pours.pours, pours.labels, config, frames=K, stride=STRIDE)

    assert done.losses[-1] < done.losses[0]
    assert (done.first, done.processes) == (True, 1)
    changed = {name for name, value in tuned.state_dict().items()
               if not torch.equal(value, before[name])}  # fmt: skip
    assert any(name.startswith("features.backbone") for name in changed)
    assert any(name.startswith("head") for name in changed)
    assert not [name for name in changed if "running" in name or name in ("offset", "factor")]


def test_a_window_gives_what_cached_features_give(few_pours: Path, cache: Path) -> None:
    """But for the grasp at rest: the median of images here, of features there."""
    head = learnt_head(few_pours, cache)
    pour = read_camera_recordings(few_pours)[0]
    images = np.array([[decode_jpeg(f.jpeg, None) for f in frame_set.frames]
                       for frame_set in frame_sets(pour.path, 2)])  # fmt: skip
    rest = np.median(images[9:24], axis=0).astype(np.uint8)
    (features,) = extract([pour], open_backbone(EDGE), cache)
    with torch.inference_mode():
        logit = network(head)(torch.from_numpy(images[None, 60 : 60 + K]),
                              torch.from_numpy(rest[None]))  # fmt: skip
    cached = head.probabilities(features.all())[60]
    assert float(logit.sigmoid()) == pytest.approx(float(cached), abs=0.1)


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_processes_share_the_windows_out_evenly_and_none_twice(few_pours: Path, ranks: int) -> None:
    pours = read_camera_recordings(few_pours)[:3]
    labels = [np.arange(len(pour)).astype(np.int8) % 2 for pour in pours]
    lanes = Lanes(pours, labels, K, STRIDE, max(LANES, ranks))
    each = [
        [window.numpy().tobytes()
         for windows, _, _ in lanes.batches(CONFIG, 0, range(rank, lanes.count, ranks))
         for window in windows]
        for rank in range(ranks)
    ]  # fmt: skip
    assert {len(part) for part in each} == {lanes.share * lanes.count // ranks}
    together = [window for part in each for window in part]
    assert len(set(together)) == len(together)
    every = sum(len(window_starts(len(pour), K, STRIDE)) for pour in pours)
    assert every - len(together) < lanes.count


def test_a_step_holds_the_same_windows_from_one_process_and_from_two(few_pours: Path) -> None:
    pours = read_camera_recordings(few_pours)[:3]
    labels = [np.arange(len(pour)).astype(np.int8) % 2 for pour in pours]
    lanes = Lanes(pours, labels, K, STRIDE, LANES)
    alone = [windows.numpy() for windows, _, _ in lanes.batches(CONFIG, 1, range(2))]
    first, second = ([w.numpy() for w, _, _ in lanes.batches(CONFIG, 1, [r])] for r in (0, 1))
    for step, one, two in zip(alone, first, second, strict=True):
        assert np.array_equal(step, np.concatenate([one, two]))


def test_a_process_decodes_its_own_part_of_the_recordings(
    few_pours: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pours = read_camera_recordings(few_pours)
    labels = [np.zeros(len(pour), np.int8) for pour in pours]
    decoded: list[str] = []
    decode = lanes_module._decode
    monkeypatch.setattr(
        lanes_module, "_decode", lambda pour: decoded.append(pour.name) or decode(pour)
    )
    for _ in Lanes(pours, labels, K, STRIDE, LANES).batches(CONFIG, 0, [0]):
        pass
    assert len(decoded) <= len(pours) // 2 + 1


@pytest.mark.slow
def test_a_training_that_was_broken_off_goes_on_with_the_same_losses(
    few_pours: Path, cache: Path, tmp_path: Path
) -> None:
    pours = load_camera_set(few_pours, "change", cache)
    head = learnt_head(few_pours, cache)
    kept = tmp_path / "edge.checkpoint"
    config = FineTuneConfig(epochs=3, learning_rate=1e-3, accelerator="cpu", kept=KeptEpochs(kept))

    def train(break_at: int | None = None) -> tuple[float, ...]:
        def look(step: int, _: int, __: float) -> None:
            if step == break_at:
                raise Broken

        done = fine_tune(network(deepcopy(head)), pours.pours, pours.labels, config, frames=K,
                         stride=STRIDE, on_step=look)  # fmt: skip
        return done.losses

    whole = train()
    kept.unlink()
    with pytest.raises(Broken):
        train(break_at=len(pours.pours) * 2)
    assert kept.exists()
    assert train() == pytest.approx(whole, abs=1e-6)


class Broken(Exception):
    """The training was broken off."""


def words(folder: Path, cache: Path, output: Path) -> list[str]:
    return ["train-backbone", str(folder), "--backbone", EDGE, "--epochs", "2", "--frames", "2",
            "--cache", str(cache), "--output", str(output), "--json"]  # fmt: skip


def under_torchrun(words: list[str]) -> list[str]:
    run = [sys.executable, "-m", "torch.distributed.run", "--standalone",
           "--nproc-per-node", "2", "-m", "taxel.cli.main"]  # fmt: skip
    return [*run, *words]


def two(forked: Forked, words: list[str], out: Path) -> list[Started]:
    """Start two processes with the variables by which torchrun tells each its place."""
    both = {"WORLD_SIZE": "2", "LOCAL_WORLD_SIZE": "2", "GROUP_RANK": "0", "GROUP_WORLD_SIZE": "1",
            "TORCHELASTIC_RUN_ID": "two", "MASTER_ADDR": "127.0.0.1",
            "MASTER_PORT": str(free_port())}  # fmt: skip
    return [
        forked.start(words, out.parent, out.with_name(f"{out.name}-{rank}"), out.parent / "err",
                     variables=both | {"RANK": str(rank), "LOCAL_RANK": str(rank)})
        for rank in range(2)
    ]  # fmt: skip


@pytest.mark.slow
def test_two_processes_killed_and_started_again_learn_as_one_does(
    few_pours: Path, cache: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    forked: Forked,
) -> None:  # fmt: skip
    """The same loss curve from one process, from two under torchrun, and from two that were
    killed and started again.
    """
    main(words(few_pours, cache, tmp_path / "1.safetensors"))
    alone = json.loads(capsys.readouterr().out)
    done = subprocess.run(under_torchrun(words(few_pours, cache, tmp_path / "2.safetensors")),
                          capture_output=True, text=True, timeout=600, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    both = json.loads(done.stdout)
    assert (alone["processes"], both["processes"]) == (1, 2)
    output = tmp_path / "killed.safetensors"
    checkpoint = tmp_path / "killed.safetensors.checkpoint"
    killed = words(few_pours, cache, output)
    processes = two(forked, killed, tmp_path / "killed")
    while not checkpoint.exists():
        assert [process.poll() for process in processes] == [None, None]
        with pytest.raises(subprocess.TimeoutExpired):
            processes[0].wait(0.02)
    for process in processes:
        process.kill()
    for process in processes:
        process.wait(30)
    assert not output.exists()
    codes = [
        process.wait(600) for process in two(forked, [*killed, "--resume"], tmp_path / "again")
    ]
    assert codes == [0, 0], (tmp_path / "err").read_text()[-2000:]
    again = json.loads((tmp_path / "again-0").read_text())

    assert both["losses"] == pytest.approx(alone["losses"], rel=0.01)
    assert again["losses"] == pytest.approx(both["losses"], abs=1e-6)
    assert sorted(path.name for path in tmp_path.glob("*.safe*")) == [
        "1.safetensors", "2.safetensors", "killed.safetensors",
    ]  # fmt: skip
    module = find_backbone(EDGE).build("logits")
    find_weights(EDGE, output).load_into(module)


@pytest.mark.parametrize(
    "words",
    [
        "--epochs 1 --output out.safetensors",
        "--backbone gel --epochs 1 --output out.safetensors",
        "--backbone edge --epochs -1 --output out.safetensors",
        "--backbone edge --epochs 1 --output out.taxel",
    ],
)
def test_options_that_make_no_sense_end_in_one_line(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["train-backbone", "pours", *words.split()])
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())
