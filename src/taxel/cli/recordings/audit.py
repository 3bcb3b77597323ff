"""`taxel audit`: leakage in recordings and in a split of them, before a reviewer finds it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from taxel.cli.options.arrays import split_given
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress
from taxel.cli.trial_verbs import refuse_other_table
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.audit.sides import Sides
    from taxel.evaluation.audit.touch_set import Pieces, TouchSet


@dataclass(frozen=True, kw_only=True)
class Audit:
    """Find data leaks in recordings, or in a split; print the accuracy that each alone gives.

    Without a split, it searches the recordings for what predicts the label without touch, and for
    what a careless split would add. The exit code is 0 whatever is found.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings of an array or of cameras, a table (CSV) of camera trials, or the
    folder of a public data set's own files (teng-glove, icub-grasp, gelsight-slip)."""
    target: str | None = None
    """The label to predict; the first with two classes unless given."""
    split: str | None = None
    """One of taxel's own splits: random, group:KEY, order:KEY:LAST[:END] or
    order:KEY:70%[:by-class]; or split for the column of that name of a table of camera trials,
    which is the default where it names tests."""
    folds: Path | None = None
    """A split as a table (CSV): recording (or group:KEY), fold or side (train, validation, test),
    and optionally start_s, end_s and label_s (seconds on the recording's clock) and view (one
    camera or finger)."""
    test: Path | None = None
    """Another folder or table that is tested; all of the first is then trained on."""
    unseen: tuple[str, ...] = ()
    """Groups that the split claims to hold out, such as object; group:KEY claims its own."""
    trained: Annotated[Path | None, tyro.conf.arg(name="run")] = None
    """A trained run's folder, to check whether its scaling was fitted on the test part too."""
    fold_count: int = 5
    """Folds that --split makes, 2 to 100."""
    steps: int | None = None
    """Rows (or frames) of a window; 2 or more; a quarter of the usual trial unless given."""
    seed: int = 0
    """Seed of folds, trees and shuffled labels."""
    all: bool = False
    """Also list what was looked for and not found."""
    json: bool = False
    """Print JSON; accuracies are shares, 0 to 1."""

    RULES: ClassVar = (
        Only(("fold-count",), "--split in folds (not order:)", lambda o: o._in_folds()),
    )

    def run(self) -> None:
        """Read, look for everything, and print."""
        from taxel.evaluation.audit.audit import STEPS, audit
        from taxel.evaluation.audit.reading import read_both, read_touch

        self._check()
        for path in filter(None, (self.data, self.test)):
            refuse_other_table(path)
        with progress() as bar:
            task = bar.add_task("reading", total=None)

            def on_read(what: str, n: int, of: int) -> None:
                bar.update(task, description=f"reading {what}", completed=n, total=of)

            if self.test is not None:
                touch, learned = read_both(self.data, self.test, self.target, on_read)
            else:
                touch, learned = read_touch(self.data, self.target, on_read), 0
            bar.update(task, completed=0, total=STEPS)
            report = audit(
                touch,
                str(self.data),
                self._sides(touch, learned),
                run=self.trained,
                steps=self.steps,
                seed=self.seed,
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )
        if self.json:
            print_json(asdict(report) | {"verdict": report.verdict, "alarms": len(report.alarms)})
            return
        from taxel.views.tables.audit import audit_table

        console.print(audit_table(report, everything=self.all))

    def _in_folds(self) -> bool:
        return self.split is not None and not self.split.startswith(("order:", "split"))

    def _check(self) -> None:
        if not split_given(self.split, self.folds, self.test) and self.unseen and not self.split:
            raise BadInput("a split beside --unseen", "none", "add --split, --folds or --test")
        if self.steps is not None and self.steps < 2:
            raise BadInput("--steps of at least 2", str(self.steps), "choose more")
        if not 2 <= self.fold_count <= 100 or not 0 <= self.seed < 2**31:
            raise BadInput("--fold-count within 2 and 100, and a --seed of at least 0",
                           f"{self.fold_count} and {self.seed}", "mend them")  # fmt: skip

    def _sides(self, touch: TouchSet, learned: int) -> tuple[Pieces, Sides] | None:
        from taxel.evaluation.audit.sides import (
            are_given,
            folder_sides,
            given_sides,
            named_sides,
            table_sides,
        )
        from taxel.evaluation.audit.touch_set import usual_steps

        steps = self.steps or usual_steps(touch)
        for key in self.unseen:
            if touch.group(key) is None:
                known = ", ".join(sorted(touch.trials[0].groups))
                mend = "name one of them"
                if key == touch.target:
                    mend = f"{key} is the label: import again with it as group:{key}, too"
                raise BadInput(f"groups among {known} for --unseen", repr(key), mend)
        own = not split_given(self.split, self.folds, self.test) and self.split is None
        if self.split == "split" or (own and are_given(touch)):
            return given_sides(touch, steps, self.unseen)
        if self.split is not None:
            return named_sides(touch, self.split, steps, self.fold_count, self.seed, self.unseen)
        if self.folds is not None:
            return table_sides(touch, self.folds, steps, self.unseen)
        if self.test is not None:
            name = f"trained on {self.data.name}, tested on {self.test.name}"
            return folder_sides(touch, learned, name, steps, self.unseen)
        return None
