"""How long a run's network takes for one window, through the engine that runs live, now.

Knows nothing about recordings or pages.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from taxel.bundles.reader import Bundle
from taxel.bundles.writer import Classifier, export_onnx
from taxel.training.run import Run

_CALLS = 500
_WARM = 50
"""Calls before the first that counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkLatency:
    """Times of one window to its probabilities, scaling included, milliseconds."""

    median_ms: float
    p95_ms: float
    p99_ms: float
    kilobytes: float
    """Of the exported model."""
    calls: int


def time_run(run: Run) -> NetworkLatency:
    """Export a run's networks and time them in ONNX Runtime, one thread, window by window.

    The windows are random numbers in the range that the scaling was fitted to: the time of a
    network does not depend on what it is shown.

    Raises:
        ValueError: The run has no networks.
    """
    if not run.networks:
        raise ValueError("needed a run with networks; got one that was only evaluated")
    contract = run.contract
    steps, channels = contract.window.steps, len(contract.channels)
    model = export_onnx(Classifier(run.networks).eval(), steps, channels)
    bundle = Bundle(contract, model)
    scale = 1.0 / np.where(contract.scaling.factor == 0, 1.0, contract.scaling.factor)
    drawn = np.random.default_rng(0).random((_CALLS, 1, steps, channels))
    values = (contract.scaling.offset + scale * drawn).astype(np.float32)
    mask = np.ones((1, steps), bool)
    for value in values[:_WARM]:
        bundle.probabilities(value, mask)
    times = np.empty(_CALLS)
    for call, value in enumerate(values):
        started = perf_counter()
        bundle.probabilities(value, mask)
        times[call] = perf_counter() - started
    median, p95, p99 = 1000.0 * np.percentile(times, [50, 95, 99])
    return NetworkLatency(
        median_ms=float(median),
        p95_ms=float(p95),
        p99_ms=float(p99),
        kilobytes=len(model) / 1000.0,
        calls=_CALLS,
    )
