"""Claims about going on after a break: never from a checkpoint that began with other weights."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from taxel.errors import BadInput
from taxel.evaluation.transitions.data import load_camera_set
from taxel.models.backbones.keras_layers import KerasClassifier
from taxel.models.weights import find_weights
from taxel.training.backbones.distilling import DistilConfig, distil
from taxel.training.backbones.fine_tuning import (
    FineTuneConfig,
    KeptEpochs,
    begin_end_to_end,
    fine_tune,
)
from taxel.training.backbones.transfer_set import TransferSet
from taxel.training.frames.extractors import open_backbone
from taxel.training.frames.features import extract
from taxel.training.frames.heads import HeadConfig

REFUSED = "one of another configuration or other data"


class _Top(nn.Module):
    """A 1000-way top over the colours of an image."""

    def __init__(self) -> None:
        super().__init__()
        self.predictions = KerasClassifier(3, 1000, "logits")

    def forward(self, images: Tensor) -> Tensor:
        logits: Tensor = self.predictions(images / 255)
        return logits


def test_a_student_does_not_go_on_from_another_start(tmp_path: Path) -> None:
    images = np.random.default_rng(0).integers(0, 256, (40, 8, 8, 3), np.uint8)
    answers = np.random.default_rng(1).normal(size=(40, 1000)).astype(np.float32)
    examples = TransferSet(images, answers, np.ones(40, bool))
    config, kept = DistilConfig(epochs=1, batch=8), KeptEpochs(tmp_path / "s.checkpoint")
    done = distil(_Top(), examples, config, kept=kept, start="one file's digest")

    with pytest.raises(BadInput, match=REFUSED):
        distil(_Top(), examples, config, kept=kept, start="another file's digest")
    assert distil(_Top(), examples, config, kept=kept, start="one file's digest") == done


@pytest.mark.skipif(find_spec("lightning_fabric") is None, reason="needs taxel[fine-tune]")
def test_a_backbone_does_not_go_on_from_other_weights_nor_another_tare(
    few_pours: Path, tmp_path: Path
) -> None:
    pours = load_camera_set(few_pours, "change", tmp_path).some(4)
    extractor = open_backbone("edge")
    features = extract(pours.pours, extractor, tmp_path)
    head = HeadConfig(frames=3, epochs=1, stride=16, tare="size")
    config = FineTuneConfig(
        accelerator="cpu", batch=2, kept=KeptEpochs(tmp_path / "edge.checkpoint")
    )

    def train(head: HeadConfig, seed: int = 0) -> tuple[float, ...]:
        own = replace(extractor, weights=find_weights("edge", seed=seed))
        torch.manual_seed(0)
        network = begin_end_to_end(own, features, pours.labels, [head])
        return fine_tune(network, pours.pours, pours.labels, config).losses

    done = train(head)

    with pytest.raises(BadInput, match=REFUSED):
        train(head, seed=1)
    with pytest.raises(BadInput, match=REFUSED):
        train(replace(head, tare="change"))
    assert train(head) == done
