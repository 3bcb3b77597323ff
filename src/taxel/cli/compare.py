"""`taxel compare`: whether one run is better than another, tested on the same windows."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import console, print_json


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Test two runs against each other, over whole sessions and over windows.

    Both must have been cross-validated on the same recordings, target, split and folds.
    """

    first: tyro.conf.Positional[Path]
    """A run's folder."""
    second: tyro.conf.Positional[Path]
    """Another; differences are second minus first."""
    group: str | None = None
    """What is taken as a whole: session, object, grasp, file …; the session where there is one."""
    json: bool = False
    """Print JSON; accuracies and differences are shares, 0 to 1."""

    def run(self) -> None:
        """Compare and print."""
        from taxel.evaluation.paired import compare_runs
        from taxel.training.run import load_run

        first, second = (load_run(path, weights=False) for path in (self.first, self.second))
        found = compare_runs(first, second, self.group)
        if self.json:
            print_json(asdict(found) | {"verdict": found.verdict})
            return
        from taxel.views.compare_table import compare_table

        console.print(compare_table(found, str(self.first), str(self.second)))
