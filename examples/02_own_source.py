"""A source of one's own: a class that fulfils the contract, recorded to a file."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo


class Ramp:
    """Two pads on which the load rises from 0 to 1 N within a second."""

    info = SensorInfo(name="pads", channels=("left", "right"), units=("N", "N"), rate_hz=100.0)
    row, ended = 0, False

    def read(self, timeout_s: float = 0.1) -> Samples:
        counter, self.row = self.row + np.arange(10), self.row + 10
        self.ended, time_s = self.row >= 100, counter / self.info.rate_hz
        values = np.stack([time_s, time_s / 2], axis=1)
        return replace(Samples.from_values(values, time_s), counter=counter)

    def marks(self) -> list[Mark]:
        return []  # a real sensor knows none

    def __enter__(self) -> "Ramp":
        return self  # a driver opens its port here, and closes it in __exit__

    def __exit__(self, *error: object) -> None: ...


with tempfile.TemporaryDirectory() as folder, Ramp() as source:
    with Recorder(Path(folder) / "ramp.mcap", Manifest.started_now(source.info, now_s=0)) as file:
        while not source.ended:
            file.write(source.read())
    print(file.statistics())
