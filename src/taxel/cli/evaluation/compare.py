"""`taxel compare`: whether one run is better than another, tested on the same windows."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from taxel.cli.printing import console, print_json

if TYPE_CHECKING:
    from taxel.evaluation.paired import Paired


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Test two runs against each other, over whole sessions and over windows.

    Both must have been cross-validated on the same recordings, target, split and folds.
    """

    first: tyro.conf.Positional[Path]
    """A run's folder."""
    second: tyro.conf.Positional[Path]
    """Another run's folder; differences are second minus first."""
    group: str | None = None
    """Groups compared as wholes: session, object, grasp, file …; sessions if there are any."""
    folds: Path | None = None
    """Only trials that this table of folds tests; neither run may have trained on them."""
    test: Path | None = None
    """Other recordings to compare on; neither run may have trained on them. Trials without the
    label are left out."""
    json: bool = False
    """Print JSON; accuracies and differences are shares, 0 to 1."""

    def run(self) -> None:
        """Compare and print."""
        found = self._found()
        if self.json:
            print_json(asdict(found) | {"verdict": found.verdict})
            return
        from taxel.views.tables.compare import compare_table

        console.print(compare_table(found, str(self.first), str(self.second)))

    def _found(self) -> Paired:
        from taxel.cli.options.arrays import split_given
        from taxel.evaluation.fold_table import read_fold_table
        from taxel.evaluation.paired import compare_predictions, compare_runs, predictions_of_both
        from taxel.evaluation.unseen_recordings import only_tested, predictions_of_both_on
        from taxel.training.run import load_run

        split_given(None, self.folds, self.test)
        fresh = self.test is not None
        first, second = (load_run(path, weights=fresh) for path in (self.first, self.second))
        target = first.contract.target
        if self.test is not None:
            ours, theirs, notes = predictions_of_both_on(first, second, self.test)
            return replace(compare_predictions(ours, theirs, target, self.group), notes=notes)
        if self.folds is not None:
            table = read_fold_table(self.folds)
            ours, theirs = (only_tested(own, table) for own in predictions_of_both(first, second))
            return compare_predictions(ours, theirs, target, self.group)
        return compare_runs(first, second, self.group)
