"""Data sets of the TENG hand that a study is measured on: the user's own, or simulated ones.

Knows nothing about models or tables.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from taxel.cli.options.arrays import RecipeOptions, usual_recipe

if TYPE_CHECKING:
    from taxel.evaluation.teng.model_comparison import ComparisonConfig


def comparison_config(
    data: Path | None, recipe: RecipeOptions, fold_count: int, model: str | None = None
) -> ComparisonConfig:
    """Return what is compared.

    Args:
        data: The user's recordings; all targets of simulated grasps unless given.
        recipe: Window, training and target.
        fold_count: Parts of the splits of the user's recordings; simulated sessions are each held
            out once.
        model: This model alone; all of them unless given.

    Raises:
        BadInput: The options do not allow it.
    """
    from taxel.evaluation.teng.model_comparison import ComparisonConfig

    if data is None:
        resolved = recipe.resolve(model=model)
    else:
        resolved = recipe.resolve(default=usual_recipe(data), model=model, data=data)
    config = ComparisonConfig(
        window=resolved.window, train=resolved.train, own_gate=resolved.own_gate
    )
    if data is not None or recipe.target is not None:
        config = replace(config, targets=(resolved.target,))
    if data is not None:
        config = replace(config, folds=fold_count)
    if model is not None:
        config = replace(config, models=(resolved.model,))
    return config


@contextmanager
def given_or_simulated_hand(
    data: Path | None, scans: int, seeds: Sequence[int]
) -> Iterator[list[Path]]:
    """Give a folder a seed: the same given one, or each its own simulated set."""
    if data is not None:
        yield [data] * len(seeds)
        return
    from taxel.sources.simulated.data_sets import simulate_presets

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folders = []
        for seed in seeds:
            simulate_presets(Path(scratch) / str(seed), ("honest",), scans, seed)
            folders.append(Path(scratch) / str(seed) / "honest")
        yield folders
