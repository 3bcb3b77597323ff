"""Small recordings of a pad on disk: a grip in N counts, pressed in several sessions."""

from pathlib import Path

import numpy as np

from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo
from taxel.training.loop import TrainConfig
from taxel.training.recipes import Recipe
from taxel.windows.config import WindowConfig

SENSOR = SensorInfo(name="pad", channels=("a", "b"), units=("N", "N"), rate_hz=100.0)
RECIPE = Recipe(
    summary="tests of pads", target="level", model="cnn1d", split="group:session",
    window=WindowConfig(steps=20, stride=20, grid_hz=None), train=TrainConfig(epochs=4),
)  # fmt: skip


def make_pads(
    folder: Path, sessions: tuple[int, ...] = (1, 2, 3), classes: tuple[str, ...] = ("2", "10"),
    seed: int = 0, series: str = "",
) -> Path:  # fmt: skip
    """Write two trials of 0.8 s a class and session; the class is the press's strength. Objects of
    another series are others."""
    rng = np.random.default_rng(seed)
    for session in sessions:
        for name in classes:
            for trial in range(2):
                groups = {"session": f"s{session}", "object": f"{series}{name}-{trial}"}
                manifest = Manifest.started_now(SENSOR, {"level": name}, groups, now_s=0.0)
                values = rng.normal(float(name), 0.5, (80, 2)).astype(np.float32)
                with Recorder(folder / f"s{session}_{name}_{trial}.mcap", manifest) as recorder:
                    recorder.write(Samples.from_values(values, np.arange(80) / 100.0))
    return folder
