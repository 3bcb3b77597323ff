"""What `taxel evaluate unknown` does."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

from taxel.cli.options import RecipeOptions
from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput

SIMULATED = ("shape", "material", "shape+material")
"""What is told of simulated grasps."""


def run_unknown(
    data: Path | None,
    options: RecipeOptions,
    scans_per_class: int,
    folds: int,
    as_json: bool,
    never: tuple[str, ...] = (),
    rejected: float = 0.05,
) -> None:
    """Print how well objects that were never learned are told from the known.

    Args:
        data: Folder of recordings of an array, whose classes are each left out in turn; the
            simulated hand with an elongated prism and a rubber composite unless given.
        options: Recipe whose window is used; the answers beside are those of its model, or
            without --model of cnn2d for the simulated hand and extra-trees for a folder.
        scans_per_class: Scans a class to simulate.
        folds: Parts of the known groups.
        as_json: Print JSON.
        never: For a folder: values of labels that are never learned, instead of each in turn.
        rejected: Share of known touch that may be called unknown, 0…1.

    Raises:
        BadInput: The options or recordings do not allow it.
    """
    if not 0 < rejected < 1:
        raise BadInput("--rejected between 0 and 1", f"{rejected:g}", "such as 0.05")
    group = None
    if options.split is not None:
        group = options.split.removeprefix("group:")
        if not group or group == options.split:
            raise BadInput(
                "--split group:KEY: whole groups are held out", options.split, "name one"
            )
    with progress() as bar:
        task = bar.add_task("starting", total=None)

        def on_step(line: str) -> None:
            bar.update(task, description=line, advance=1)

        if data is None:
            _simulated(options, group, scans_per_class, folds, as_json, rejected, on_step)
        else:
            _folder(data, options, group, folds, as_json, never, rejected, on_step)


def _simulated(
    options: RecipeOptions,
    group: str | None,
    scans: int,
    folds: int,
    as_json: bool,
    rejected: float,
    on_step: Callable[[str], None],
) -> None:
    from taxel.evaluation.unknown import UnknownConfig, find_unknown, kinds_of
    from taxel.sim.teng_unknown import UNKNOWN_MATERIALS, UNKNOWN_SHAPES
    from taxel.windows.dataset import load_dataset

    if options.recipe == "teng":  # the default: touch that a session's gain does not hide
        options = replace(options, recipe="teng-referenced")
    recipe = options.resolve()
    results = []
    with _simulated_folder(scans, options.seed) as folder:
        for target in (options.target,) if options.target else SIMULATED:
            dataset = load_dataset(folder, recipe.window, target=target)
            config = UnknownConfig(
                target=target, model=recipe.model, train=recipe.train, group=group, folds=folds,
                rejected=rejected, seed=options.seed,
            )  # fmt: skip
            kinds = kinds_of(dataset, target, UNKNOWN_SHAPES + UNKNOWN_MATERIALS)
            results.append(find_unknown(dataset, kinds, config, on_step))
    if as_json:
        print_json([asdict(one) for one in results])
        return
    from taxel.views.unknown_results import unknown_tables

    console.print(unknown_tables(results))


def _folder(
    data: Path,
    options: RecipeOptions,
    group: str | None,
    folds: int,
    as_json: bool,
    never: tuple[str, ...],
    rejected: float,
    on_step: Callable[[str], None],
) -> None:
    from taxel.evaluation.unknown import UnknownConfig, find_unknown, kinds_of, leave_each_out
    from taxel.views.unknown_results import left_out_table, unknown_tables
    from taxel.windows.dataset import load_dataset

    recipe = options.resolve()
    dataset = load_dataset(data, recipe.window, target=recipe.target)
    own = recipe.split.removeprefix("group:")  # the recipe's, where these recordings have it
    if group is None and all(own in trial.groups for trial in dataset.trials):
        group = own
    config = UnknownConfig(
        target=recipe.target, model=options.model or "extra-trees", train=recipe.train,
        group=group, folds=folds, rejected=rejected, seed=options.seed,
    )  # fmt: skip
    if never:
        found = find_unknown(dataset, kinds_of(dataset, recipe.target, never), config, on_step)
        if as_json:
            print_json([asdict(found)])
        else:
            console.print(unknown_tables([found]))
            for note in dataset.notes:
                say(note)
        return
    results, refused = leave_each_out(dataset, config, on_step)
    if as_json:
        each = {name: asdict(one) for name, one in results.items()}
        print_json({**each, **{name: {"refused": why} for name, why in refused.items()}})
    else:
        console.print(left_out_table(results, refused))
        for note in dataset.notes:
            say(note)


@contextmanager
def _simulated_folder(scans: int, seed: int) -> Iterator[Path]:
    from taxel.sources.data_sets import simulate_unknown

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        simulate_unknown(Path(scratch) / "set", scans, seed)
        yield Path(scratch) / "set"
