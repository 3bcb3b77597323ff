"""Motor currents over time, as a picture.

Knows nothing about hands or ports.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from taxel.plotting import finished, plt
from taxel.recordings.whole import write_whole


def save_currents(
    path: Path, time_s: Sequence[float], values: Sequence[Sequence[int]], contact_ma: int
) -> None:
    """Draw each motor's current and the contact current.

    Args:
        path: The picture, .png.
        time_s: Monotonic seconds of each reading.
        values: mA of each motor, a row a reading.
        contact_ma: Where a motor stops, milliamperes.
    """
    figure, axes = plt.subplots(figsize=(8.0, 3.5), layout="constrained")
    time = np.array(time_s) - (time_s[0] if time_s else 0.0)
    for number, column in enumerate(np.array(values).T if values else ()):
        axes.plot(time, column, label=f"motor {number + 1}")
    axes.axhline(contact_ma, color="0.5", linestyle=":", label="contact")
    axes.set(xlabel="time, s", ylabel="motor current, mA")
    axes.legend(loc="upper right", ncols=5, fontsize="small")
    write_whole(path, finished(figure))
