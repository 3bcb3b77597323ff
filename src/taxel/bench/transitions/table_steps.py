"""Times of the steps of Tables 1 and 2: each backbone with each head, on this machine.

Times need no trained weights. Beside each stands the share of the machine's matrix product that
the step reached in the same run. Knows nothing about accuracies.

Background of our choices: docs/decisions/0056.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

from taxel.bench.rows import Row, quietest
from taxel.bundles.engine import Precision
from taxel.evaluation.cards.claims import STEP, STEP_SHARE, grasp_row

if TYPE_CHECKING:
    from taxel.evaluation.transitions.step_times import StepTime
    from taxel.models.transition import TransitionModel
    from taxel.training.frames.extractors import BackboneEngine, BackboneExtractor

ROUNDS, REPEATS = 3, 6
"""Rounds, and streaming steps in each; the quietest round counts. Source: our choice."""
THREADS = 2
DEFAULT = "onnxruntime f32"
"""Engine and number format of the rows that the claims card shows."""
CARD_WAYS: list[tuple[BackboneEngine, Precision]] = [("torch", "f32"), ("torch", "bf16")]
"""On a graphics card, where there is one."""


def table_steps() -> list[tuple[str, Callable[[], list[Row]]]]:
    """Return what to measure and how: a backbone of the paper each, so that each is kept.

    On a graphics card, where there is one, its steps are measured apart from the processor's.
    """
    from taxel.models.torch_engine import best_device
    from taxel.models.transition import TRANSITION_MODELS

    published = [model for model in TRANSITION_MODELS.values() if model.published]
    backbones = dict.fromkeys(model.backbone for model in published)
    measures: list[tuple[str, Callable[[], list[Row]]]] = []
    for where, ways in (("", processor_ways()), (", on a graphics card", CARD_WAYS)):
        if where and best_device().type == "cpu":
            continue
        for backbone in backbones:
            models = [model for model in published if model.backbone == backbone]
            measures.append((f"steps of Tables 1 and 2, {backbone}{where}",
                             partial(backbone_rows, backbone, models, ways)))  # fmt: skip
    return measures


def processor_ways() -> list[tuple[BackboneEngine, Precision]]:
    """Return the engines and number formats of the processor that can be measured here."""
    ways: list[tuple[BackboneEngine, Precision]] = [("onnxruntime", "f32")]
    if find_spec("openvino"):
        ways += [("openvino", "f32"), ("openvino", "bf16")]
    return ways


def backbone_rows(
    backbone: str,
    models: list[TransitionModel],
    ways: Sequence[tuple[BackboneEngine, Precision]],
) -> list[Row]:
    """Return the rows of one backbone, which is exported once, if any engine needs that.

    Args:
        backbone: Its name.
        models: Networks that begin with it.
        ways: Engines and number formats.
    """
    from taxel.bundles.engine import open_engine
    from taxel.evaluation.transitions.step_times import time_step
    from taxel.training.frames.extractors import open_backbone

    rows: list[Row] = []
    exported: BackboneExtractor | None = None
    for engine, precision in ways:
        if engine == "torch":
            ready = open_backbone(backbone, engine=engine, precision=precision)
        else:
            exported = exported or open_backbone(backbone, threads=THREADS)
            ready = replace(
                exported, engine=open_engine(exported.model, engine, precision, THREADS)
            )
        for model in models:
            rounds = [
                time_step(
                    model.name, engine=engine, precision=precision, threads=THREADS,
                    repeats=REPEATS, extractor=ready,
                )
                for _ in range(ROUNDS)
            ]  # fmt: skip
            rows += step_rows(model, f"{engine} {precision}", rounds)
    return rows


def step_rows(model: TransitionModel, way: str, rounds: list[StepTime]) -> list[Row]:
    """Return a model's rows from its rounds: the time, and where it was measured the share.

    Args:
        model: The model.
        way: Engine and number format; all but the default's stand in the rows' names.
        rounds: What was measured.
    """
    behind = "" if way == DEFAULT else f", {way}"
    limits = [step.limit_gflops for step in rounds if step.limit_gflops is not None]
    best = min(rounds, key=lambda step: step.stream_ms)
    best = replace(best, limit_gflops=max(limits, default=None))
    where = best.engine if way.startswith("torch") else f"{way}, {THREADS} threads"
    note = (
        f"{where}; the whole window again {best.window_ms:.1f} ms; "
        f"{model.parameters:,} numbers, {model.size_mb():.1f} MB"
    )
    name = grasp_row(model.name, best.frames, f"{STEP}{behind}")
    limit_ms = model.published.step_ms if model.published else 0.0
    row = quietest(name, [step.stream_ms for step in rounds], "ms", limit_ms,
                   f"{note}; the goal is the paper's, on an RTX 4090")  # fmt: skip
    rows = [row if model.published else replace(row, goal="", ok=None)]
    if best.share is not None:
        note = f"of {best.limit_gflops:.0f} GFLOP/s, the most of {len(rounds)} rounds"
        rows.append(Row(name=grasp_row(model.name, best.frames, f"{STEP_SHARE}{behind}"),
                        value=best.share, unit="share", note=note))  # fmt: skip
    return rows
