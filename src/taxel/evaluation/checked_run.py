"""A cross-validation as a run without weights, to be compared and reported later.

Any model can stand in it, library baselines too, which have no weights to save.
Knows nothing about folders.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from taxel.evaluation.checked import Checked
from taxel.training.environment import Made
from taxel.training.run import Run, contract_of
from taxel.windows.scaling import Scaling


def run_of_check(data: Path, checked: Checked) -> Run:
    """Return a run that `save_run` can keep and `load_run(…, weights=False)` gives back.

    Args:
        data: The data set's path, as it was given.
        checked: Its cross-validation.
    """
    channels = len(checked.dataset.sensor.channels)
    unscaled = Scaling(
        kind="none", offset=np.zeros(channels, np.float32), factor=np.ones(channels, np.float32)
    )
    recipe, pooled = checked.recipe, checked.pooled
    accuracy = {pooled.split: pooled.scores.accuracy}
    return Run(
        networks=(),
        contract=contract_of(checked.dataset, recipe.target, recipe.model, (), unscaled, accuracy),
        train=recipe.train,
        history=(),
        data=str(data),
        predictions=checked.predictions,
        trivial=checked.trivial,
        curves=checked.curves,
        made=Made.now(),
    )
