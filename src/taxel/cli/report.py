"""`taxel report`: one page with everything that must stand beside an accuracy."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput

if TYPE_CHECKING:
    from collections.abc import Callable

    from taxel.evaluation.data_card import DataCard
    from taxel.training.run import Run


@dataclass(frozen=True, kw_only=True)
class Report:
    """Write runs and saved results as one self-contained HTML page; or the card of claims.

    The page holds the data card, the splits drawn, accuracies with intervals beside trivial
    baselines and published values, confusion, reliability, latency measured now, environment
    and commands.
    """

    runs: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Runs' folders, as taxel train writes them; two or more are compared with one another."""
    output: Path | None = None
    """The page to write, such as report.html."""
    data: Path | None = None
    """The recordings; where the runs were trained on them unless given."""
    tables: tuple[Path, ...] = ()
    """Files that taxel evaluate teng-table, transition-tables, grasp-warnings or slip-trials
    printed with --json."""
    sweep: tuple[Path, ...] = ()
    """Files that taxel sweep printed with --json."""
    latency: bool = True
    """Measure how long a window takes through ONNX Runtime, now."""
    claims: Path | None = None
    """Write the card of both papers' claims to this Markdown file, from the stored rows of
    taxel bench; needs no run."""
    json: bool = False
    """Print JSON: what was written."""

    def run(self) -> None:
        """Gather and write."""
        if self.claims is None and self.output is None:
            raise BadInput("a file to write", "none", "name one with --output report.html")
        if self.output is not None and not (self.runs or self.tables or self.sweep):
            raise BadInput(
                "at least one run, or a file with --tables or --sweep", "none",
                "train a run with: taxel train DATA --output RUN",
            )  # fmt: skip
        for path in (self.output, self.claims):
            if path is not None and path.is_dir():
                raise BadInput("a file to write", f"the folder {path}", "name a file in it")
        written = []
        if self.output is not None:
            self._page(self.output)
            written.append(str(self.output))
        if self.claims is not None:
            from taxel.bench.claims_card import write_claims_card

            write_claims_card(self.claims)
            written.append(str(self.claims))
        if self.json:
            print_json({"written": written})
            return
        for line in written:
            console.print(line)

    def _page(self, output: Path) -> None:
        from taxel.evaluation.latency import time_run
        from taxel.training.environment import Made
        from taxel.training.run import load_run
        from taxel.views.report import RunPage, write_run_report
        from taxel.views.report.measured_parts import read_sweep

        tables = {path.name: _read(path) for path in self.tables}
        sweeps = {path.name: read_sweep(_read(path), path.name) for path in self.sweep}
        paths = dict(zip(_names(self.runs), self.runs, strict=True))
        with progress() as bar:
            task = bar.add_task("starting", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            runs: dict[str, Run] = {}
            latencies = {}
            for name, path in paths.items():
                on_step(f"run · {name}")
                runs[name] = load_run(path, weights=False)
                if self.latency and (path / "weights-0.safetensors").exists():
                    on_step(f"latency · {name}")
                    latencies[name] = time_run(load_run(path))
            write_run_report(
                output,
                RunPage(
                    runs=runs,
                    card=self._card(runs, on_step),
                    latencies=latencies,
                    sweeps=sweeps,
                    tables=tables,
                    made=Made.now(),
                ),
            )

    def _card(self, runs: dict[str, Run], on_step: Callable[[str], None]) -> DataCard | None:
        """Read the recordings; None where the runs' own are not at hand."""
        from taxel.evaluation.data_card import data_card

        if self.data is not None:
            return data_card(self.data, on_step)
        first = next(iter(runs.values()), None)
        if first is None or not Path(first.data).exists():
            return None
        return data_card(Path(first.data), on_step)


def _names(paths: tuple[Path, ...]) -> list[str]:
    """Return a short name for each run: its folder's, or its path where two are called alike."""
    names = [path.resolve().name for path in paths]
    chosen = [n if names.count(n) == 1 else str(p) for n, p in zip(names, paths, strict=True)]
    if len(set(chosen)) < len(chosen):
        raise BadInput("each run once", f"{', '.join(chosen)}", "leave the second out")
    return chosen


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(
            f"JSON that can be read in {path}", f"none ({error})", "write it again with --json"
        ) from error
