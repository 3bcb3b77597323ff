"""What `taxel evaluate teng-models` and `taxel evaluate teng-cleaning` do."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from taxel.cli.options import RecipeOptions
from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.model_comparison import ComparisonConfig

RUNS = 3
"""Runs of each way of cleaning: simulated data sets, or seeds where a folder is given."""


def run_models(
    data: Path | None, options: RecipeOptions, scans_per_class: int, folds: int, as_json: bool
) -> None:
    """Print every model under random windows and with groups held out.

    Args:
        data: Folder of recordings of an array; the simulated hand's honest preset unless given.
        options: Recipe whose window and training are used; its model alone where one is given.
        scans_per_class: Scans a class to simulate.
        folds: Parts of the splits of a given folder; simulated sessions are each held out once.
        as_json: Print JSON.

    Raises:
        BadInput: The options or recordings do not allow it.
    """
    from taxel.evaluation.model_comparison import compare_models

    config = _config(options, data, folds)
    with _folders(data, scans_per_class, [options.seed]) as (folder,), progress() as bar:
        steps = 2 * len(config.targets) * (len(config.models) + 1)
        task = bar.add_task("starting", total=steps)
        results, trivial = compare_models(
            folder, config, lambda line: bar.update(task, description=line, advance=1)
        )
    if as_json:
        print_json(
            {
                "models": [asdict(one) for one in results],
                "trivial": [asdict(one) for one in trivial],
            }
        )
        return
    from taxel.views.model_results import model_tables

    console.print(model_tables(results, trivial))


def run_cleaning(
    data: Path | None, options: RecipeOptions, scans_per_class: int, folds: int, as_json: bool
) -> None:
    """Print what denoising, segmentation and augmentation give under the held-out split.

    Args:
        data: Folder of recordings of an array, told with three seeds; three simulated data
            sets of the honest preset, each with its own seed, unless given.
        options: Recipe whose window and training are used.
        scans_per_class: Scans a class to simulate.
        folds: Parts of the splits of a given folder; simulated sessions are each held out once.
        as_json: Print JSON.

    Raises:
        BadInput: The options or recordings do not allow it.
    """
    from taxel.evaluation.cleaning_gains import compare_cleaning

    if options.model is not None:
        raise BadInput("no --model: cleaning is measured with cnn2d", options.model, "leave it out")
    config = _config(options, data, folds)
    seeds = [options.seed + run for run in range(RUNS)]
    with _folders(data, scans_per_class, seeds) as folders, progress() as bar:
        task = bar.add_task("starting", total=None)
        gains, trivial = compare_cleaning(
            list(zip(folders, seeds, strict=True)),
            config,
            lambda line: bar.update(task, description=line, advance=1),
        )
    if as_json:
        print_json(
            {
                "gains": [{**asdict(one), "verdict": one.verdict} for one in gains],
                "trivial": [asdict(one) for one in trivial],
            }
        )
        return
    from taxel.views.model_results import cleaning_tables

    console.print(cleaning_tables(gains, trivial))


def _config(options: RecipeOptions, data: Path | None, folds: int) -> ComparisonConfig:
    from taxel.evaluation.model_comparison import ComparisonConfig

    if options.split is not None:
        raise BadInput("no --split: both kinds are measured", options.split, "leave it out")
    recipe = options.resolve()
    config = ComparisonConfig(window=recipe.window, train=recipe.train)
    if data is not None or options.target is not None:
        config = replace(config, targets=(recipe.target,))
    if data is not None:
        config = replace(config, folds=folds)
    if options.model is not None:
        config = replace(config, models=(recipe.model,))
    return config


@contextmanager
def _folders(data: Path | None, scans: int, seeds: Sequence[int]) -> Iterator[list[Path]]:
    """Give a folder a seed: the same given one, or each its own simulated set."""
    if data is not None:
        yield [data] * len(seeds)
        return
    from taxel.sources.data_sets import simulate_presets

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folders = []
        for seed in seeds:
            simulate_presets(Path(scratch) / str(seed), ("honest",), scans, seed)
            folders.append(Path(scratch) / str(seed) / "honest")
        yield folders
