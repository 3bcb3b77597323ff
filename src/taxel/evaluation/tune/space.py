"""Which settings of a recipe are searched, within which limits.

The window stays as the recipe has it, so that all trials part the same windows into the same
folds. Knows nothing about recordings or scores.

Source of all limits: our choice, docs/decisions/0050.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

from taxel.errors import BadInput
from taxel.models.catalogue import find_network
from taxel.training.recipes import Recipe


class Ask(Protocol):
    """What proposes values: an Optuna trial."""

    def suggest_float(
        self, name: str, low: float, high: float, *, step: float | None = None, log: bool = False
    ) -> float:
        """Return a number within limits."""
        ...

    def suggest_int(
        self, name: str, low: int, high: int, *, step: int = 1, log: bool = False
    ) -> int:
        """Return a whole number within limits."""
        ...

    def suggest_categorical(self, name: str, choices: Any) -> Any:
        """Return one of some choices."""
        ...


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting of a recipe."""

    suggest: Callable[[Ask, str], Any]
    put: Callable[[Recipe, Any], Recipe]


def _train(name: str) -> Callable[[Recipe, Any], Recipe]:
    return lambda recipe, value: replace(recipe, train=replace(recipe.train, **{name: value}))


def _augment(name: str) -> Callable[[Recipe, Any], Recipe]:
    def put(recipe: Recipe, value: Any) -> Recipe:
        augment = replace(recipe.train.augment, **{name: value})
        return replace(recipe, train=replace(recipe.train, augment=augment))

    return put


SETTINGS: dict[str, Setting] = {
    "learning-rate": Setting(
        lambda ask, name: ask.suggest_float(name, 3e-4, 3e-2, log=True), _train("learning_rate")
    ),
    "epochs": Setting(lambda ask, name: ask.suggest_int(name, 3, 40, log=True), _train("epochs")),
    "batch": Setting(
        lambda ask, name: ask.suggest_categorical(name, (32, 64, 128, 256)), _train("batch")
    ),
    "weight-decay": Setting(
        lambda ask, name: ask.suggest_float(name, 1e-5, 0.1, log=True), _train("weight_decay")
    ),
    "label-smoothing": Setting(
        lambda ask, name: ask.suggest_float(name, 0.0, 0.2), _train("label_smoothing")
    ),
    "noise": Setting(lambda ask, name: ask.suggest_float(name, 0.0, 0.1), _augment("noise")),
    "gain": Setting(lambda ask, name: ask.suggest_float(name, 0.0, 0.4), _augment("gain")),
    "offset": Setting(lambda ask, name: ask.suggest_float(name, 0.0, 0.4), _augment("offset")),
}
"""Name → how it is proposed and where it goes."""
USUAL = ("learning-rate", "epochs", "weight-decay", "label-smoothing", "noise", "gain")
"""What is searched unless something else is named."""


@dataclass(frozen=True, slots=True)
class Space:
    """What is searched around a recipe."""

    settings: tuple[str, ...] = USUAL
    models: tuple[str, ...] = ()
    """Networks to choose among; empty keeps the recipe's own."""

    def check(self) -> None:
        """Refuse settings and networks that do not exist.

        Raises:
            BadInput: There is no such setting or network, or nothing to search.
        """
        for name in self.settings:
            if name not in SETTINGS:
                raise BadInput(f"settings among {', '.join(SETTINGS)}", repr(name), "name those")
        for name in self.models:
            find_network(name)
        if not self.settings and len(self.models) < 2:
            raise BadInput("something to search", "nothing", "name --settings or --models")

    def propose(self, ask: Ask) -> dict[str, Any]:
        """Return a value of each setting, as an Optuna trial proposes them."""
        values = {name: SETTINGS[name].suggest(ask, name) for name in self.settings}
        if len(self.models) > 1:
            values["model"] = ask.suggest_categorical("model", self.models)
        return values

    def apply(self, recipe: Recipe, values: Mapping[str, Any]) -> Recipe:
        """Return a recipe with values put in; without any, as it is."""
        if len(self.models) == 1:
            recipe = replace(recipe, model=self.models[0])
        for name, value in values.items():
            if name == "model":
                recipe = replace(recipe, model=value)
            else:
                recipe = SETTINGS[name].put(recipe, value)
        return recipe
