"""Claims about training end to end: it learns, keeps normalisation, and shares windows out."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.cli.main import main
from taxel.evaluation.transitions.data import load_camera_set, tracks_of
from taxel.frame_codec import decode_jpeg
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.weights import find_weights
from taxel.training.extractors import open_backbone
from taxel.training.features import extract
from taxel.training.fine_tuning import EndToEnd, FineTuneConfig, _Own, _windows, fine_tune
from taxel.training.heads import HeadConfig, TrainedHead, fit_head
from taxel.windows.camera_recordings import frame_sets, read_camera_recordings
from taxel.windows.sequence import window_starts

EDGE = "edge"
K, STRIDE = 3, 30
pytest.importorskip("lightning_fabric")


def learnt_head(folder: Path, cache: Path) -> TrainedHead:
    pours = load_camera_set(folder, "change", cache)
    features = extract(pours.pours, open_backbone(EDGE), cache)
    config = HeadConfig(frames=K, epochs=1, tare="size")
    everything = np.arange(len(pours.pours), dtype=np.intp)
    return fit_head(tracks_of(features, pours.labels, everything), config)


def network(head: TrainedHead) -> EndToEnd:
    module = find_backbone(EDGE).build("logits")
    find_weights(EDGE).load_into(module)
    return EndToEnd(module, EDGE, head).eval()


def test_training_lowers_the_loss_and_leaves_normalisation_as_it_was(
    few_pours: Path, tmp_path: Path
) -> None:
    pours = load_camera_set(few_pours, "change", tmp_path)
    tuned = network(learnt_head(few_pours, tmp_path))
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


def test_a_window_gives_what_cached_features_give(few_pours: Path, tmp_path: Path) -> None:
    """But for the grasp at rest: the median of images here, of features there."""
    head = learnt_head(few_pours, tmp_path)
    pour = read_camera_recordings(few_pours)[0]
    images = np.array([[decode_jpeg(f.jpeg, None) for f in one.frames]
                       for one in frame_sets(pour.path, 2)])  # fmt: skip
    rest = np.median(images[9:24], axis=0).astype(np.uint8)
    (features,) = extract([pour], open_backbone(EDGE), tmp_path)
    with torch.inference_mode():
        logit = network(head)(torch.from_numpy(images[None, 60 : 60 + K]),
                              torch.from_numpy(rest[None]))  # fmt: skip
    cached = head.probabilities(features.all())[60]
    assert float(logit.sigmoid()) == pytest.approx(float(cached), abs=0.1)


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_processes_share_the_windows_out_evenly_and_none_twice(few_pours: Path, ranks: int) -> None:
    pours = read_camera_recordings(few_pours)[:2]
    labels = [np.arange(len(pour)).astype(np.int8) % 2 for pour in pours]
    places = [window_starts(len(pour), K, STRIDE) for pour in pours]
    share = sum(map(len, places)) // ranks
    each = [
        [window.tobytes() for window, _, _ in _windows(
            pours, labels, places, K, np.random.default_rng(5), _Own(rank, ranks, share))]
        for rank in range(ranks)
    ]  # fmt: skip
    assert {len(one) for one in each} == {share}
    together = [window for one in each for window in one]
    assert len(set(together)) == len(together)


@pytest.mark.slow
def test_two_processes_under_torchrun_end_with_one_file(few_pours: Path, tmp_path: Path) -> None:
    verb = ["train-backbone", str(few_pours), "--backbone", EDGE, "--epochs", "1", "--frames", "2",
            "--cache", str(tmp_path / "cache"), "--output", str(tmp_path / "edge.safetensors"),
            "--json"]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2",
         "-m", "taxel.cli.main", *verb],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert json.loads(done.stdout)["processes"] == 2
    assert [path.name for path in tmp_path.glob("edge*")] == ["edge.safetensors"]
    module = find_backbone(EDGE).build("logits")
    find_weights(EDGE, tmp_path / "edge.safetensors").load_into(module)


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
