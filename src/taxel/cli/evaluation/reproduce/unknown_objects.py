"""`taxel reproduce unknown-objects`: how well objects that were never learned are rejected."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.cli.options.arrays import RecipeOptions, check_share, usual_recipe
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.unknown.objects import UnknownConfig
    from taxel.training.recipes import Recipe

SIMULATED = ("shape", "material", "shape+material")
"""What is predicted of simulated grasps."""


@dataclass(frozen=True, kw_only=True)
class UnknownObjects:
    """Print how often unknown objects' touch is rejected, and how often known touch is.

    On the simulated hand with an elongated prism and a rubber composite; or on recordings of an
    array, of which each class is left out in turn. Answers without rejection are shown beside it.
    """

    data: Path | None = None
    """A folder of recordings of an array; simulated unless given."""
    never: tuple[str, ...] = ()
    """With --data: values of the label that are never learned, instead of each in turn."""
    reject_novel: float = 0.05
    """Reject novel touch: the share of known touch that may be rejected, 0…1."""
    scans_per_class: int = 160_000
    """Scans a class to simulate."""
    split: str | None = None
    """group:KEY: whole groups are held out; sessions unless given."""
    fold_count: int = 5
    """Parts of the known groups."""
    model: str | None = None
    """Model whose answers stand beside: the recipe's on simulated grasps, extra-trees with --data
    unless given."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    RULES: ClassVar = (
        Only(("scans-per-class",), "no --data", lambda o: o.data is None),
        Only(("never",), "--data", lambda o: o.data is not None),
    )

    def run(self) -> None:
        """Measure and print."""
        check_share("--reject-novel", self.reject_novel)
        group = self._group()
        with progress() as bar:
            task = bar.add_task("starting", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            if self.data is None:
                self._simulated(group, on_step)
            else:
                self._folder(self.data, group, on_step)

    def _group(self) -> str | None:
        """Return which groups are held out, where that is said."""
        if self.split is None:
            return None
        group = self.split.removeprefix("group:")
        if not group or group == self.split:
            raise BadInput("--split group:KEY: whole groups are held out", self.split, "name one")
        return group

    def _config(self, recipe: Recipe, target: str, model: str, group: str | None) -> UnknownConfig:
        from taxel.evaluation.unknown.objects import UnknownConfig

        return UnknownConfig(
            target=target, model=model, train=recipe.train, group=group, folds=self.fold_count,
            rejected=self.reject_novel, seed=self.recipe.seed,
        )  # fmt: skip

    def _simulated(self, group: str | None, on_step: Callable[[str], None]) -> None:
        from taxel.evaluation.unknown.objects import find_unknown, kinds_of
        from taxel.sim.teng.unknown_objects import UNKNOWN_MATERIALS, UNKNOWN_SHAPES
        from taxel.windows.dataset import load_dataset

        # By default touch that a session's gain does not hide.
        recipe = self.recipe.resolve(default="teng-referenced", model=self.model)
        results = []
        with _simulated_folder(self.scans_per_class, self.recipe.seed) as folder:
            for target in (self.recipe.target,) if self.recipe.target else SIMULATED:
                dataset = load_dataset(folder, recipe.window, target=target)
                kinds = kinds_of(dataset, target, UNKNOWN_SHAPES + UNKNOWN_MATERIALS)
                config = self._config(recipe, target, recipe.model, group)
                results.append(find_unknown(dataset, kinds, config, on_step))
        if self.json:
            print_json([asdict(found) for found in results])
            return
        from taxel.views.tables.unknown import unknown_tables

        console.print(unknown_tables(results))

    def _folder(self, data: Path, group: str | None, on_step: Callable[[str], None]) -> None:
        from taxel.evaluation.unknown.objects import find_unknown, kinds_of, leave_each_out
        from taxel.training.final import check_gate
        from taxel.views.tables.unknown import left_out_table, unknown_tables
        from taxel.windows.dataset import load_dataset

        recipe = self.recipe.resolve(default=usual_recipe(data), model=self.model, data=data)
        dataset = load_dataset(data, recipe.window, target=recipe.target)
        check_gate(dataset, own=recipe.own_gate)
        own = (recipe.split or "").removeprefix("group:")  # where these recordings have it
        if group is None and all(own in trial.groups for trial in dataset.trials):
            group = own
        config = self._config(recipe, recipe.target, self.model or "extra-trees", group)
        if self.never:
            kinds = kinds_of(dataset, recipe.target, self.never)
            found = find_unknown(dataset, kinds, config, on_step)
            table = unknown_tables([found])
            plain: Any = [asdict(found)]
        else:
            results, refused = leave_each_out(dataset, config, on_step)
            table = left_out_table(results, refused)
            plain = {name: asdict(found) for name, found in results.items()}
            plain |= {name: {"refused": why} for name, why in refused.items()}
        if self.json:
            print_json(plain)
            return
        console.print(table)
        for note in dataset.notes:
            say(note)


@contextmanager
def _simulated_folder(scans: int, seed: int) -> Iterator[Path]:
    from taxel.sources.simulated.data_sets import simulate_unknown

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        simulate_unknown(Path(scratch) / "set", scans, seed)
        yield Path(scratch) / "set"
