"""`taxel split`: what a split holds out, without training; as a table where wanted."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import tyro

from taxel.cli.long_work import LongWork
from taxel.cli.options.arrays import RecipeOptions, only_label, split_given, usual_recipe
from taxel.cli.options.pairs import Pairs
from taxel.cli.options.rules import Only
from taxel.cli.options.trials import TrialOptions
from taxel.cli.printing import command, print_json, progress, say
from taxel.cli.training.train_expert import outer_split
from taxel.cli.trial_verbs import of_trials, refuse_other_table
from taxel.errors import BadInput
from taxel.plain_text import number_of

if TYPE_CHECKING:
    from taxel.evaluation.fold_summary import SplitSummary


@dataclass(frozen=True, kw_only=True)
class Split:
    """Print what a split holds out, without training: each fold's groups, trials and classes.

    The folds are those of a training with the same options; with --recipe or --window, of a
    training or cross-validation of that recipe.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings of an array or of tactile cameras, or a table (CSV) of camera
    trials."""
    target: str | None = None
    """The label to predict; needed only where the data have more than one."""
    split: str | None = None
    """group:KEY holds out whole groups in turn, such as group:session. order:KEY:LAST[:END] or
    order:KEY:70% tests the later ones, with :by-class behind it those of each class. random splits
    single windows of an array, or single camera trials. split is the column of that name of camera
    trials. Unless given: the recipe's, if it names one; else sessions are held out, else objects,
    persons or days, else files (camera trials: the column split where it names tests, else objects,
    else sessions or another group)."""
    folds: Path | None = None
    """A split as a table (CSV) instead: recording or group:KEY, and fold or side."""
    test: Path | None = None
    """Another folder or table that is tested; all of PATH is then trained on."""
    fold_count: int = 5
    """Folds, where groups are held out in turn, 2 or more."""
    seed: int = 0
    """Seed of the folds."""
    recipe: str | None = None
    """Arrays: the folds of this recipe, such as array, which come after its windows are cut."""
    window: Pairs = ()
    """Arrays: changes to the recipe's window, such as steps=50."""
    output: Path | None = None
    """Also write the split to this new file: a table (CSV) that --folds reads."""
    json: bool = False
    """Print JSON."""

    RULES: ClassVar = (
        Only(
            ("fold-count",), "a split in folds (not order:, split, --folds or --test)",
            lambda o: o._in_folds(),
        ),
        Only(
            ("output",), "a split that is made here (no --folds or --test)",
            lambda o: not (o.folds or o.test),
        ),
    )  # fmt: skip

    def run(self) -> None:
        """Read, split and print."""
        if self.output is not None:
            _check_new(self.output)
        cameras = of_trials(self.data)
        if not cameras:
            refuse_other_table(self.data)
        with progress() as bar:
            work = LongWork(bar)
            work.step("reading", "reading")
            found, rows = self._of_cameras(work) if cameras else self._of_array()
        if self.json:
            print_json(asdict(found) | {"data": str(self.data), "rows_written": rows})
            return
        from taxel.views.tables.split import split_lines

        for line in split_lines(found):
            say(line)
        if self.output is not None:
            verb = "evaluate-trials" if cameras else "evaluate"
            again = command("taxel", verb, self.data, "--target", found.target,
                            "--folds", self.output)  # fmt: skip
            say(f"{self.output}: {number_of(rows, 'row')}; next:", again)

    def _of_array(self) -> tuple[SplitSummary, int]:
        """Return the split of an array's recordings, and how many rows of it were written."""
        from taxel.evaluation.expert import Task, read_and_part
        from taxel.evaluation.fold_jobs import Source, open_source
        from taxel.evaluation.fold_summary import summary_of, write_split

        options = RecipeOptions(
            recipe=self.recipe, target=self.target, window=self.window, seed=self.seed
        )
        named = outer_split(self.split, self.folds, self.test, self.fold_count,
                            options.checked_seed())  # fmt: skip
        if options.unnamed and self.split != "random":
            target = self.target or only_label(self.data)
            base, split = read_and_part(
                Task(data=self.data, target=target, split=named, test=self.test)
            )
            dataset = base.dataset
        else:
            recipe = options.resolve(
                default=usual_recipe(self.data), split=self.split, data=self.data
            )
            given = split_given(self.split, self.folds, self.test)
            opened = open_source(
                Source(path=self.data, recipe=recipe, folds=self.fold_count, given=given)
            )
            target, dataset, split = recipe.target, opened.dataset, opened.split
        rows = 0 if self.output is None else write_split(self.output, dataset, split)
        notes = () if self.folds else split.notes  # a table's own have lines of their own
        return replace(summary_of(dataset, target, split), notes=notes), rows

    def _of_cameras(self, work: LongWork) -> tuple[SplitSummary, int]:
        """Return the split of camera trials, and how many rows of it were written."""
        from taxel.evaluation.camera_trials.sides import summary_of_sides
        from taxel.evaluation.fold_summary import write_folds_of

        for name, given in (("--recipe", self.recipe), ("--window", self.window)):
            if given:
                raise BadInput(f"recordings of an array beside {name}", "camera trials",
                               f"leave {name} out")  # fmt: skip
        options = TrialOptions(
            target=self.target, split=self.split, folds=self.folds, test=self.test,
            fold_count=self.fold_count, seed=self.seed,
        )  # fmt: skip
        trials, split, _ = options.read_and_part(self.data, work)
        rows = 0 if self.output is None else write_folds_of(
            self.output, split.folds, [(name, None) for name in trials.names], trials.groups,
            split.group,
        )  # fmt: skip
        return summary_of_sides(trials.target, trials.labels, trials.groups, split), rows

    def _in_folds(self) -> bool:
        from taxel.training.recipes import find_recipe

        own = None if self.recipe is None else find_recipe(self.recipe).split
        split = self.split or own or ""
        return not (self.folds or self.test or split.startswith(("order:", "split")))


def _check_new(path: Path) -> None:
    from taxel.recordings.whole import check_place

    check_place(path)
    if os.path.lexists(path):
        raise BadInput("a new file for --output", f"{path}, which is there already",
                       "name another, or remove it")  # fmt: skip
