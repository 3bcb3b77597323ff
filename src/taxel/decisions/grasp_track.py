"""One grasp as a monitor saw it, moment by moment. Knows nothing about models or truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspTrack:
    """One grasp of a recording."""

    states: NDArray[np.int8]
    """Shape (n,): numbers of `taxel.decisions.stability.Stability`, oldest first."""
    time_s: NDArray[np.float64]
    """Shape (n,): of the newest frame, the recording's clock, seconds."""
    scores: NDArray[np.float64]
    """Shape (n,): probability or score, 0…1; NaN where there was none."""
    labels: Mapping[str, str]
    """Of the grasp, such as outcome."""
    groups: Mapping[str, str]
    """Of the grasp, such as object or cup."""
