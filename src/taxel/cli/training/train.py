"""`taxel train`: find what recognises best, or take a recipe; judge it; train it on all."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from taxel.cli.options.arrays import (
    FOLD_COUNT,
    RecipeOptions,
    check_share,
    split_given,
    usual_recipe,
)
from taxel.cli.options.rules import Only
from taxel.cli.trial_verbs import refuse_other_table
from taxel.held import only_writer


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a recogniser on recordings of an array, and measure its accuracy.

    Without a recipe, it searches for the best window, features and models, by validation inside the
    training part.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings."""
    output: Path | None = None
    """Folder for the run (weights, configuration, accuracy); runs/DATA-TARGET unless given. An
    older run there is replaced."""
    check: bool = True
    """Cross-validate first, so that the run states its accuracy."""
    split: str | None = None
    """How accuracy is measured. group:KEY holds out whole groups, such as group:session.
    order:KEY:LAST[:END] trains up to LAST and tests above it, up to END; order:KEY:70% trains on
    the first 70 % and tests the later ones (of each class, where classes follow one another, or the
    first would lack one; always with :by-class behind it). KEY is a group, or time: when a trial
    begins in its recording. random splits single windows, which leaks, and trains the recipe,
    without a search. Unless given: the recipe's, if it names one; else sessions are held out, else
    objects, persons or days, else files."""
    folds: Path | None = None
    """Measure on a published split instead: a table (CSV) with the columns recording (or
    group:KEY), side (train, validation, test) or fold, and optionally start_s, seconds."""
    test: Path | None = None
    """Measure on the recordings of this folder instead; all of PATH is then the training part."""
    fold_count: int = 5
    """Folds of the cross-validation, 2 or more."""
    model: str | None = None
    """Name of the model, such as cnn2d; the recipe's unless given."""
    minutes: float = 5.0
    """Without a recipe: time limit of the search, minutes, above 0."""
    max_mb: float = 20.0
    """Without a recipe: largest size of the bundle, megabytes, above 0."""
    max_us: float = 2000.0
    """Without a recipe: longest time that a window may take live, on one core, microseconds, above
    0."""
    like: Path | None = None
    """Without a recipe: take the window, features and models that an earlier run chose, from its
    expert.json, without a search."""
    reject_novel: float | None = None
    """Also train a novelty test, which answers UNKNOWN to novel touch, with this false rejection
    rate, 0…1, such as 0.05; none unless given."""
    fresh: bool = False
    """With a recipe: start from the beginning. Otherwise folds and checkpoints that an interrupted
    run left beside --output are reused, if recipe, data and software are the same."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    RULES: ClassVar = (
        Only(
            ("fold-count", "fresh", "test"), "a cross-validation (no --no-check)", lambda o: o.check
        ),
        FOLD_COUNT,
        Only(
            ("minutes", "max-mb", "max-us", "like"),
            "no recipe, model, window or --split random",
            lambda o: o._free,
            lambda o: o._recipe_typed,
        ),
        Only(("fresh",), "a recipe", lambda o: not o._free),
    )

    @property
    def _free(self) -> bool:
        """Whether the best is to be found: nothing of a recipe is named, nor asked for."""
        named = self.model is not None or self.split == "random"
        return self.recipe.unnamed and not named

    @property
    def _recipe_typed(self) -> str:
        """What was typed that makes it a recipe's training, as it was typed."""
        if self.model is not None:
            return f"--model {self.model}"
        return "--split random" if self.split == "random" else self.recipe.named

    def run(self) -> None:
        """Find or take, judge, train and save."""
        refuse_other_table(self.data)
        if self._free:
            self._find()
            return
        output = self.output or Path("runs") / f"{self.data.resolve().name}-{self._target()}"
        with only_writer(output):
            self._train(output)

    def _target(self) -> str:
        recipe = self.recipe.resolve(
            default=usual_recipe(self.data), model=self.model, data=self.data
        )
        return recipe.target

    def _find(self) -> None:
        if self.reject_novel is not None:
            check_share("--reject-novel", self.reject_novel)
        from taxel.cli.training.train_expert import ExpertOptions, train_default

        train_default(
            ExpertOptions(
                data=self.data, output=self.output, target=self.recipe.target, split=self.split,
                folds=self.folds, test=self.test, fold_count=self.fold_count,
                usual_folds=type(self).fold_count,
                minutes=self.minutes, max_mb=self.max_mb, max_us=self.max_us, like=self.like,
                reject_novel=self.reject_novel,
                check=self.check, seed=self.recipe.checked_seed(), json=self.json,
            )
        )  # fmt: skip

    def _train(self, output: Path) -> None:
        from taxel.cli.training.train_recipe import RecipeTraining, train_recipe

        if self.reject_novel is not None:
            check_share("--reject-novel", self.reject_novel)
        given = split_given(self.split, self.folds, self.test)
        recipe = self.recipe.resolve(
            default=usual_recipe(self.data), model=self.model, split=self.split, data=self.data
        )
        train_recipe(
            RecipeTraining(
                data=self.data, output=output, recipe=recipe, given=given,
                folds=self.fold_count if self.check else None,
                reject_novel=self.reject_novel, fresh=self.fresh, json=self.json,
            )
        )  # fmt: skip
