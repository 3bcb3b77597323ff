"""PyTorch as an engine of features: the same numbers as the exported model gives."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from taxel.errors import BadInput
from taxel.evaluation.transitions.step_times import time_step
from taxel.models import torch_engine
from taxel.models.torch_engine import TorchEngine, best_device, device_words
from taxel.training.frames import jobs
from taxel.training.frames.extractors import CameraImages, open_backbone
from taxel.training.frames.features import BATCH

CPU = torch.device("cpu")


def test_features_are_those_of_the_exported_model() -> None:
    images = list(np.random.default_rng(0).integers(0, 256, (3, 240, 320, 3), np.uint8))
    exported = open_backbone("edge")
    by_torch = open_backbone("edge", engine="torch")
    assert np.abs(by_torch.of(images) - exported.of(images)).max() < 1e-4
    in_16_bits = open_backbone("edge", engine="torch", precision="bf16").of(images)
    spread = exported.of(images).std()
    assert 0 < np.abs(in_16_bits - exported.of(images)).max() < 0.1 * spread
    keys = {extractor.key for extractor in (exported, by_torch)}
    assert len(keys) == 2, "each has a cache of its own"


def test_what_runs_live_is_exported_when_it_is_asked_for() -> None:
    assert len(open_backbone("edge", engine="torch").model) > 100_000


def test_8_bit_numbers_are_refused() -> None:
    frames = np.zeros((1, 240, 320, 3), np.uint8)
    with pytest.raises(BadInput, match="f32 or bf16 for PyTorch"):
        open_backbone(
            "edge", engine="torch", precision="int8", images=CameraImages(calibration=[frames[0]])
        )


class Counting(nn.Module):
    """Gives each row's mean, and notes how many rows it was given."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[int] = []

    def forward(self, values: Tensor) -> Tensor:
        self.rows.append(len(values))
        return values.float().mean(dim=1, keepdim=True)


def test_a_card_meets_few_numbers_of_rows_and_gives_the_rows_that_were_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    module = Counting()
    engine = TorchEngine(module, CPU)
    monkeypatch.setattr(torch_engine.TorchEngine, "on_card", True)
    for rows in (1, 2, 17, 33, 40):
        values = np.arange(rows * 4, dtype=np.float32).reshape(rows, 4)
        assert np.allclose(engine.run(values=values)[:, 0], values.mean(axis=1))
    assert module.rows == [1, 2, 32, 48, 48], "a step of a stream stays as it is"


def test_more_images_at_once_where_a_card_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    extractor = open_backbone("edge", engine="torch")
    if best_device() == CPU:
        assert extractor.at_once == BATCH
    monkeypatch.setattr(torch_engine.TorchEngine, "on_card", True)
    assert extractor.at_once > BATCH
    assert open_backbone("edge").at_once == BATCH


def test_one_card_serves_one_process() -> None:
    assert jobs._in_this_process(open_backbone("edge", engine="torch"))
    assert not jobs._in_this_process(open_backbone("edge"))


def test_a_step_is_timed_with_the_head_in_the_same_engine() -> None:
    step = time_step("edge+lstm", engine="torch", repeats=3)
    assert step.stream_ms > 0 < step.window_ms
    assert step.engine == f"torch f32 on {device_words(best_device())}"
    assert step.share is None
