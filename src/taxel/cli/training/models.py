"""`taxel models`: all models and recipes, with their parameter counts."""

from __future__ import annotations

from dataclasses import dataclass

from rich.table import Table

from taxel.cli.printing import console, print_json


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
        from taxel.evaluation.usual_split import IN_WORDS
        from taxel.models.catalogue import MODELS, Network, count_parameters
        from taxel.models.transition import TRANSITION_MODELS
        from taxel.training.recipes import RECIPES

        rows = []
        for name, model in MODELS.items():
            parameters = None
            if isinstance(model, Network):
                parameters = count_parameters(model.build(self.steps, self.channels, self.classes))
            rows.append(
                {
                    "name": name,
                    "parameters": parameters,
                    "kind": "network" if isinstance(model, Network) else "baseline",
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
        if self.json:
            print_json(rows)
            return
        table = Table(
            title=f"models, for windows of {self.steps} × {self.channels} "
            f"and {self.classes} classes; grasp transitions: 8 frames of 2 cameras",
            title_justify="left",
        )
        for column in ("name", "parameters", "what", "source"):
            table.add_column(column, justify="right" if column == "parameters" else "left")
        for row in rows:
            count = f"{row['parameters']:,}" if row["parameters"] else "–"
            table.add_row(str(row["name"]), count, str(row["summary"]), str(row["source"]))
        console.print(table)
        recipes = Table(title="recipes (--recipe)", title_justify="left")
        for column in ("name", "for", "model", "window", "split"):
            recipes.add_column(column)
        for name, recipe in RECIPES.items():
            window = f"{recipe.window.steps} rows" + (
                f", gate {recipe.window.gate:g}" if recipe.window.gate is not None else ""
            )
            recipes.add_row(name, recipe.summary, recipe.model, window, recipe.split or IN_WORDS)
        console.print(recipes)
