"""`taxel models`: all models and recipes, with their parameter counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rich.table import Table

from taxel.cli.printing import console, print_json
from taxel.errors import BadInput

_MOST = 10_000
"""Rows, channels or classes: larger networks would not fit the memory."""


@dataclass(frozen=True, kw_only=True)
class Models:
    """List all models with their number of parameters, and all recipes."""

    steps: int = 12
    """Rows in a window, for counting."""
    channels: int = 12
    """Channels, for counting."""
    classes: int = 3
    """Classes, for counting."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the lists."""
        for name in ("steps", "channels", "classes"):
            if not 1 <= getattr(self, name) <= _MOST:
                raise BadInput(f"--{name} within 1 and {_MOST}", str(getattr(self, name)),
                               "choose another")  # fmt: skip
        rows = self._rows()
        if self.json:
            print_json(rows)
            return
        console.print(self._models_table(rows))
        console.print(_recipes_table())

    def _rows(self) -> list[dict[str, Any]]:
        """Return what is known of each model, as --json prints it.

        Networks are built without memory for their numbers: the largest would need 50 GB.
        """
        import torch

        from taxel.models.catalogue import MODELS, Network, count_parameters
        from taxel.models.transition import TRANSITION_MODELS

        rows: list[dict[str, Any]] = []
        for name, model in MODELS.items():
            parameters, kind = None, "baseline"
            if isinstance(model, Network):
                kind = "network"
                with torch.device("meta"):
                    network = model.build(self.steps, self.channels, self.classes)
                parameters = count_parameters(network)
            rows.append(
                {
                    "name": name,
                    "parameters": parameters,
                    "kind": kind,
                    "scaling": model.scaling,
                    "summary": model.summary,
                    "source": model.source,
                }
            )
        for name, transition in TRANSITION_MODELS.items():
            rows.append(
                {
                    "name": name,
                    "parameters": transition.parameters,
                    "kind": "grasp transitions",
                    "scaling": "standard",
                    "summary": transition.summary,
                    "source": "Sensors 2024, 24, 5080" if transition.published else "ours",
                }
            )
        return rows

    def _models_table(self, rows: list[dict[str, Any]]) -> Table:
        table = Table(
            title=f"models, for windows of {self.steps} × {self.channels} "
            f"and {self.classes} classes; grasp transitions: 8 frames of 2 cameras",
            title_justify="left",
        )
        for column in ("name", "parameters", "what", "source"):
            table.add_column(column, justify="right" if column == "parameters" else "left")
        for row in rows:
            count = f"{row['parameters']:,}" if row["parameters"] else "–"
            table.add_row(row["name"], count, row["summary"], row["source"])
        return table


def _recipes_table() -> Table:
    from taxel.evaluation.usual_split import IN_WORDS
    from taxel.training.recipes import RECIPES

    table = Table(title="recipes (--recipe)", title_justify="left")
    for column in ("name", "for", "model", "window", "split"):
        table.add_column(column)
    for name, recipe in RECIPES.items():
        gate = "" if recipe.window.gate is None else f", gate {recipe.window.gate:g}"
        window = f"{recipe.window.steps} rows{gate}"
        table.add_row(name, recipe.summary, recipe.model, window, recipe.split or IN_WORDS)
    return table
