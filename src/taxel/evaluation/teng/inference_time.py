"""How long one window takes, through the engine that runs live.

Knows nothing about tables.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.reader import Bundle
from taxel.bundles.writer import Classifier, export_onnx
from taxel.training.fitting import Fitted, Job
from taxel.training.run import contract_of
from taxel.windows.dataset import Dataset

_NETWORK_CALLS = 200
_ESTIMATOR_CALLS = 5
"""Calls to take the median of; library baselines take milliseconds each."""


def milliseconds_per_window(
    fitted: Fitted, dataset: Dataset, part: NDArray[np.intp], job: Job
) -> float:
    """Return the median time for one window, milliseconds.

    Networks run in ONNX Runtime on one thread, scaling included, as in the live
    path; library baselines run as they are.

    Args:
        fitted: What predicts.
        dataset: Windows as they are cut.
        part: Which of them are predicted in turn, shape (n,).
        job: What was fitted.
    """
    predict: Callable[[NDArray[np.float32], NDArray[np.bool_]], NDArray[Any]]
    values, mask = dataset.windows.values[part], dataset.windows.mask[part]
    if isinstance(fitted.model, tuple):
        contract = contract_of(dataset, job.target, job.model, fitted.model, fitted.scaling, {})
        model = export_onnx(
            Classifier(fitted.model).eval(), dataset.config.steps, len(dataset.sensor.channels)
        )
        predict, calls = Bundle(contract, model).probabilities, _NETWORK_CALLS
    else:
        predict, calls = fitted.probabilities, _ESTIMATOR_CALLS
    times = []
    for call in range(calls):
        window = slice(call % len(part), call % len(part) + 1)
        started = perf_counter()
        predict(values[window], mask[window])
        times.append(perf_counter() - started)
    return 1000.0 * float(np.median(times))
