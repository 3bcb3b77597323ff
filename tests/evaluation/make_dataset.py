"""A small data set without files, for tests of splits, metrics and tables."""

import numpy as np

from taxel.labels.trials import Trial
from taxel.signals import SensorInfo
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import Dataset
from taxel.windows.windower import Windows


def make_dataset(
    sessions: int = 6,
    trials_a_session: int = 6,
    windows_a_trial: int = 3,
    classes: int = 3,
    config: WindowConfig | None = None,
    one_session_a_class: bool = False,
    seed: int = 0,
) -> Dataset:
    """Return windows whose first channel tells the class, with a gain of the session's own."""
    config = config or WindowConfig(steps=6, stride=6)
    rng = np.random.default_rng(seed)
    trials, owner, values = [], [], []
    for session in range(sessions):
        gain = rng.normal(1.0, 0.1)
        for index in range(trials_a_session):
            kind = session % classes if one_session_a_class else index % classes
            start = 10.0 * len(trials)
            trials.append(
                Trial(
                    recording=f"s{session}.mcap",
                    start_s=start,
                    end_s=start + 5.0,
                    labels={"shape": f"c{kind}"},
                    groups={
                        "recording": f"s{session}",
                        "session": f"s{session}",
                        "trial": f"s{session}#{index}",
                        "number": str(index + 1),
                    },
                )
            )
            for _ in range(windows_a_trial):
                samples = rng.normal(0.2, 0.05, (config.steps, 4))
                samples[:, 0] = gain * (kind + 1) + rng.normal(0, 0.1)
                values.append(samples)
                owner.append(len(trials) - 1)
    n = len(values)
    starts = np.array([trials[o].start_s for o in owner]) + np.tile(
        np.arange(windows_a_trial), n // windows_a_trial
    )
    windows = Windows(
        np.array(values, np.float32),
        np.ones((n, config.steps), bool),
        np.ones(n, np.float32),
        np.zeros(n, np.float32),
        starts,
        starts + 0.5,
    )
    sensor = SensorInfo(
        name="t", channels=tuple("abcd"), units=("V",) * 4, rate_hz=100.0, full_scale=3.3
    )
    return Dataset(
        windows=windows,
        trial=np.array(owner, np.intp),
        trials=tuple(trials),
        sensor=sensor,
        config=config,
        digest="0",
        notes=(),
    )
