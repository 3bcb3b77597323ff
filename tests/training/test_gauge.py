"""Claims about the gauge: a backbone trained end to end learns how far images are from the rule."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.cli.main import main
from taxel.evaluation.transitions.data import CameraSet, load_camera_set
from taxel.training.backbones.lanes import Lanes
from taxel.training.frames.extractors import open_backbone
from taxel.training.frames.features import extract
from taxel.training.frames.heads import HeadConfig
from taxel.training.frames.labels import frame_excess

if find_spec("lightning_fabric") is None:
    pytest.skip(
        "lightning-fabric is not installed: pip install 'taxel[fine-tune]'", allow_module_level=True
    )

from taxel.training.backbones.fine_tuning import (
    EndToEnd,
    FineTuneConfig,
    _misread,
    begin_end_to_end,
    fine_tune,
)

EDGE = "edge"
CONFIGS = [HeadConfig(frames=3, epochs=1, tare="size", head=head)
           for head in ("lstm", "transformer")]  # fmt: skip


@pytest.fixture(scope="module")
def pours(few_pours: Path, tmp_path_factory: pytest.TempPathFactory) -> CameraSet:
    return load_camera_set(few_pours, "change", tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("features")


def begun(pours: CameraSet, cache: Path) -> EndToEnd:
    extractor = open_backbone(EDGE)
    features = extract(pours.pours, extractor, cache)
    excess = frame_excess(pours.pours, pours.signals)
    return begin_end_to_end(extractor, features, pours.labels, CONFIGS, excess)


def test_it_begins_as_the_best_line_through_the_features(pours: CameraSet, cache: Path) -> None:
    network = begun(pours, cache)
    excess = np.minimum(np.concatenate(frame_excess(pours.pours, pours.signals)), 2.0)
    rows = []
    for track in extract(pours.pours, open_backbone(EDGE), cache):
        change = np.abs(track.all() - np.median(track.all()[9:24], axis=0))
        rows.append((change - network.offset.numpy()) * network.factor.numpy())
    with torch.inference_mode():
        read = network.gauge(torch.from_numpy(np.concatenate(rows))).squeeze(-1).numpy()
    error = read - excess
    assert error.std() < 0.5 * excess.std()
    assert abs(error.mean()) < 0.05


def test_each_frame_of_a_stretch_comes_with_its_change(pours: CameraSet, cache: Path) -> None:
    excess = frame_excess(pours.pours, pours.signals)
    lanes = Lanes(pours.pours[:1], pours.labels[:1], 3, 1, excess=excess[:1])
    (_, start) = lanes.places(0, 0)[0]
    batch = next(lanes.batches(FineTuneConfig(), 0, [0]))
    frames = batch.frames.shape[1]
    assert np.array_equal(batch.excess[0].numpy(), excess[0][start : start + frames])
    network = begun(pours, cache).eval()
    with torch.inference_mode():  # and the gauge reads each frame's own
        _, read = network(batch.images, batch.frames, batch.rest)
    wanted = batch.excess.clamp(max=2.0)
    assert np.corrcoef(read.ravel().numpy(), wanted.ravel().numpy())[0, 1] > 0.8
    assert float((read - wanted).abs().mean()) < 0.25
    unknown = next(Lanes(pours.pours[:1], pours.labels[:1], 3, 1).batches(FineTuneConfig(), 0, [0]))
    assert unknown.excess.shape == batch.excess.shape
    assert unknown.excess.isnan().all()
    other = Lanes(pours.pours[:1], pours.labels[:1], 3, 1)
    assert lanes.digest() != other.digest(), "a checkpoint of the one does not go on as the other"


def test_far_above_the_threshold_it_need_not_say_how_far() -> None:
    excess = torch.tensor([0.5, 1.0, 3.0, 3.0])
    right = _misread(torch.tensor([0.5, 1.0, 2.0, 9.0]), excess)
    assert float(right) == 0.0
    assert float(_misread(torch.tensor([0.5, 1.4, 2.0, 9.0]), excess)) > 0.05
    assert float(_misread(torch.tensor([0.5, 1.0, 1.2, 9.0]), excess)) > 0.05


@pytest.mark.parametrize("known", [False, True])
def test_it_learns_where_the_change_is_known(pours: CameraSet, cache: Path, known: bool) -> None:
    network = begun(pours, cache)
    before = network.gauge.weight.detach().clone()
    heads = [parameter.detach().clone() for parameter in network.heads.parameters()]
    excess = frame_excess(pours.pours, pours.signals)
    fine_tune(
        network, pours.pours[:2], pours.labels[:2],
        FineTuneConfig(accelerator="cpu"), excess=excess[:2] if known else None,
    )  # fmt: skip
    assert torch.equal(network.gauge.weight, before) != known
    assert all(not torch.equal(now, then)
               for now, then in zip(network.heads.parameters(), heads, strict=True)
               if now.numel() > 64)  # fmt: skip
    logits, read = network(
        torch.zeros(4, 240, 320, 3, dtype=torch.uint8), torch.zeros(1, 5, 2, dtype=torch.long),
        torch.zeros(1, 2, 2, dtype=torch.long),
    )  # fmt: skip
    assert (logits.shape, read.shape) == ((2, 1, 3), (1, 5, 2))


def test_the_monitor_that_is_proposed_has_what_the_backbone_was_trained_with(
    few_pours: Path, cache: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another rule than that of the threshold: there is no gauge, and the command says the rule."""
    main(["train-backbone", str(few_pours), "--backbone", EDGE, "--epochs", "1", "--cache",
          str(cache), "--output", str(tmp_path / "w.safetensors"), "--rule", "slip", "--head",
          "lstm", "--frames", "3"])  # fmt: skip
    (further,) = [line for line in capsys.readouterr().out.splitlines() if "train-monitor" in line]
    assert "--head lstm --rule slip --frames 3 --output" in further
