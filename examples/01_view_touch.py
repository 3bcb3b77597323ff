"""Look at raw touch: read the simulated hand for two seconds and draw it in the terminal."""

import numpy as np
from rich.console import Console

from taxel.signals import Samples
from taxel.sources.opening import open_source
from taxel.views.traces import TraceScreen

with open_source("sim://teng?seed=1&seconds=2&speed=max") as source:
    screen = TraceScreen(source.info)
    parts: list[Samples] = []
    while not source.ended:
        samples = source.read()
        screen.add(samples)
        parts.append(samples)

touch = Samples.join(parts)
Console(width=100).print(screen.render(100))
strongest = int(touch.values.max(axis=0).argmax())
print(f"{len(touch):,} scans of {touch.values.shape[1]} channels, all usable: {touch.usable.all()}")
print(
    f"strongest: {source.info.channels[strongest]}, "
    f"{np.max(touch.values[:, strongest]):.3f} {source.info.units[strongest]}"
)
