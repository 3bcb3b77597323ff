"""A model of one's own: one dict entry, then cross-validated as every other is."""

import tempfile
from pathlib import Path

from torch import Tensor, nn

from taxel.evaluation.crossval import pool, run_fold
from taxel.evaluation.splits import by_group
from taxel.models.catalogue import MODELS, Network
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig
from taxel.windows.config import TENG_WINDOW
from taxel.windows.dataset import load_dataset


class Means(nn.Module):
    """One linear layer over each channel's mean: what touch gives without its course in time."""

    def __init__(self, steps: int, channels: int, classes: int) -> None:
        super().__init__()
        self.last = nn.Linear(channels, classes)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        logits: Tensor = self.last((values * mask.unsqueeze(2)).sum(1) / mask.sum(1, keepdim=True))
        return logits


MODELS["means"] = Network(summary="means", source="ours", build=Means, scaling="standard")

with tempfile.TemporaryDirectory() as folder:
    simulate_presets(Path(folder), ("honest",), 16_000, 0)
    data = load_dataset(Path(folder) / "honest", TENG_WINDOW, target="shape")
split = by_group(data, "shape", "session", folds=3, seed=0)
for name in ("means", "cnn2d"):
    job = Job(model=name, target="shape", train=TrainConfig(epochs=30, batch=32))
    result = pool(data, split, [run_fold(data, fold, job) for fold in split.folds])
    print(f"{name:<6} {split.name}: {result.scores.accuracy:.3f} of {len(data)} windows")
