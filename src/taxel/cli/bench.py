"""`taxel bench`: measured figures beside their goals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput
from taxel.recordings.whole import check_place

if TYPE_CHECKING:
    from taxel.bench.rows import Row


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure taxel's performance on this machine, and print each figure beside its goal."""

    name: tyro.conf.Positional[
        Literal[
            "teng",
            "transitions",
            "faults",
            "closed-loop",
            "soak",
            "boards",
            "audit",
            "data",
            "scale",
        ]
        | None
    ] = None
    """Which figures; none with --page, which then writes all that are stored."""
    full: bool = False
    """Also measure what takes longer than a few minutes, and keep all rows with a stamp."""
    only: str = ""
    """Only the measurements whose name holds this text; stored rows of others are kept."""
    data: Path | None = None
    """Folder that holds teng-glove/, icub-grasp/, gelsight-slip/, biotacsp-stability/ and
    fabric-slide/, for --full."""
    store: Path | None = None
    """Folder for what --full measures; in a checkout, the figures that ship unless given."""
    page: Path | None = None
    """A page of Markdown to write: alone, all stored figures; with `faults`, its rows by fault."""
    json: bool = False
    """Print JSON: a list of {name, value, unit, goal, ok, note, stamp}."""
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)

    RULES: ClassVar = (
        Only(
            ("full", "only", "data", "store", "json", "workers", "run-on"),
            "a bench's name",
            lambda o: o.name is not None,
        ),
        Only(("data", "store"), "--full", lambda o: o.full),
    )

    def run(self) -> None:
        """Measure and print."""
        from taxel.bench.rows import rows_table, store_folder

        if self.name is None:
            self._write_figures()
            return
        self._check_page(self.name)
        bench = import_module(f"taxel.bench.{self.name.replace('-', '_')}.steps")
        folder = store_folder(self.store) if self.full else None
        with self.work.open(), progress() as bar:
            task = bar.add_task("starting", total=None)
            rows = self._measured(
                self.name, bench, folder,
                lambda line: bar.update(task, description=line, advance=1),
            )  # fmt: skip
        if self.page is not None:
            from taxel.bench.faults.page import write_fault_page

            write_fault_page(self.page, rows)
        if self.json:
            print_json([asdict(row) for row in rows])
        else:
            console.print(rows_table(rows))

    def _check_page(self, name: str) -> None:
        """Refuse a page that cannot be written, before anything is measured."""
        if self.page is None:
            return
        if name != "faults" or self.only:
            raise BadInput(
                "--page alone, or with `faults` and all of its rows",
                f"--page with `{name}`{' and --only' if self.only else ''}",
                "leave --page out, or measure all faults",
            )
        check_place(self.page)

    def _measured(
        self, name: str, bench: ModuleType, folder: Path | None, on_step: Callable[[str], None]
    ) -> list[Row]:
        """Return the rows, measured now or stored; with --full all that are measured are kept."""
        from taxel.bench.rows import measure, store, stored

        quick = self._chosen(bench.quick_steps())
        slow = self._chosen(bench.full_steps(self.data)) if self.full else []
        if self.only and not quick + slow:
            raise BadInput("a measurement's name for --only", repr(self.only), _named(bench))
        rows = measure(quick, on_step)
        if self.full:
            digest = bench.data_digest(self.data)
            for step in slow:  # each kept at once: a broken run loses one at most
                found = measure([step], on_step)
                store(name, found, digest, only=step[0], folder=folder)
                rows += found
            measured = {row.name for row in rows}
            rows = store(name, rows, digest, only=self.only, folder=folder)
        else:
            measured = {row.name for row in rows}
            rows += [row for row in stored(name) if row.name not in measured]
        return [row for row in rows if row.name in measured] if self.only else rows

    def _write_figures(self) -> None:
        from taxel.bench.figure_page import write_figure_page

        if self.page is None:
            raise BadInput("a bench's name, or --page FILE alone", "neither", "see: taxel bench -h")
        count = write_figure_page(self.page)
        say(f"{self.page}: {count} stored figures")

    def _chosen(self, steps: list[tuple[str, Any]]) -> list[tuple[str, Any]]:
        return [step for step in steps if self.only in step[0]]


def _named(bench: ModuleType) -> str:
    names = [name for name, _ in [*bench.quick_steps(), *bench.full_steps(None)]]
    return f"one of: {'; '.join(names)} (some with --full)"
