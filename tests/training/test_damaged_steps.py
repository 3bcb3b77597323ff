"""A checkpoint whose optimiser's steps are not as they were written is refused in one line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
import torch
from torch import nn

from taxel.errors import BadInput
from taxel.training.backbones.fine_tuning import EpochLoss
from taxel.training.checkpoints import load_checkpoint, save_checkpoint


@dataclass(frozen=True)
class _Config:
    seed: int = 0


class _OddSteps(torch.optim.Adam):
    """Names its first parameter's state as no optimiser does."""

    def state_dict(self) -> dict[str, object]:
        """As Adam's, but for a name."""
        return {**super().state_dict(), "state": {"first": {"step": torch.ones(1)}}}


def test_steps_of_a_parameter_without_a_number_are_refused(tmp_path: Path) -> None:
    network = nn.Linear(2, 2)
    path = tmp_path / "x.checkpoint"
    odd = _OddSteps(network.parameters())
    save_checkpoint(path, network, odd, _Config(), [EpochLoss(1.0)], "job")
    adam = torch.optim.Adam(network.parameters())
    with pytest.raises(BadInput, match="damaged history or steps"):
        load_checkpoint(path, network, adam, _Config(), EpochLoss, "job")
