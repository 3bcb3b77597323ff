"""`taxel report`: one page with everything that must stand beside an accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import tyro

from taxel.cli.evaluation.html_pages import older_page
from taxel.cli.options.rules import Only
from taxel.cli.printing import print_json, progress, say, say_aside
from taxel.errors import BadFile, BadInput
from taxel.foreign.json_text import read_json
from taxel.plain_text import visible_names

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from taxel.bundles.versions import History
    from taxel.evaluation.audit.finding import Audit
    from taxel.evaluation.cards.data import DataCard
    from taxel.training.run import Run


@dataclass(frozen=True, kw_only=True)
class Report:
    """Write runs and saved results as one self-contained HTML page; or the card of claims.

    The page holds the data card, the splits drawn, accuracies with intervals beside trivial
    baselines and published values, confusion, reliability, latency measured now, environment
    and commands.
    """

    runs: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Runs' folders; two or more are compared with one another."""
    output: Path | None = None
    """The page to write, such as report.html; an older page there is replaced."""
    data: Path | None = None
    """The recordings; where the runs were trained on them unless given."""
    tables: tuple[Path, ...] = ()
    """Published tables and warnings, saved as JSON when they were measured."""
    sweep: tuple[Path, ...] = ()
    """Robustness curves, saved as JSON."""
    reactions: tuple[Path, ...] = ()
    """Logs of alarms, reactions and outcomes, NAME.trials.csv."""
    audit: bool = False
    """Look for leaks in the recordings under the runs' own splits, now; takes minutes."""
    audited: tuple[Path, ...] = ()
    """Audits, saved as JSON."""
    latency: bool = True
    """Measure how long a window takes through ONNX Runtime, now."""
    claims: Path | None = None
    """Write the card of both papers' claims to this Markdown file, from stored measurements; needs
    no run. With --keep, results are stored first."""
    keep: tuple[Path, ...] = ()
    """With --claims: tables, simulated sets and measurements, saved as JSON, whose values are kept
    in the package for the card."""
    json: bool = False
    """Print JSON: what was written."""

    RULES: ClassVar = (
        Only(
            ("data", "tables", "sweep", "reactions", "audit", "audited", "latency"),
            "--output", lambda o: o.output is not None,
        ),
        Only(("data", "audit", "latency"), "a run", lambda o: o.runs),
    )  # fmt: skip

    def run(self) -> None:
        """Gather and write."""
        if self.claims is None and self.output is None:
            raise BadInput("a file to write", "none", "name one with --output report.html")
        if self.output is not None and not (
            self.runs or self.tables or self.sweep or self.reactions
        ):
            raise BadInput(
                "at least one run, or a file with --tables, --sweep or --reactions", "none",
                "train a run with: taxel train DATA --output RUN",
            )  # fmt: skip
        if self.keep and self.claims is None:
            raise BadInput("--claims FILE beside --keep", "none", "name the card's file")
        if self.claims is not None and self.claims.is_dir():
            raise BadInput("a file to write", f"the folder {self.claims}", "name a file in it")
        older = {
            str(self.output): older_page(self.output),
            str(self.claims): self.claims is not None and self.claims.exists(),
        }
        written = []
        if self.output is not None:
            self._page(self.output)
            written.append(str(self.output))
        if self.claims is not None:
            from taxel.bench.claims_card import keep_for_claims, write_claims_card

            if self.keep:
                keep_for_claims({path.name: _read(path) for path in self.keep})
            write_claims_card(self.claims)
            written.append(str(self.claims))
        if self.json:
            print_json({"written": written, "replaced": [path for path in written if older[path]]})
            return
        for path in written:
            say(f"{path}, replaced" if older[path] else path)

    def _page(self, output: Path) -> None:
        from taxel.bundles.versions import read_history
        from taxel.evaluation.cards.latency import time_run
        from taxel.recordings.trial_log import read_trial_log
        from taxel.training.environment import Provenance
        from taxel.training.run import load_run
        from taxel.views.report import RunPage, write_run_report
        from taxel.views.report.audit_part import read_audit
        from taxel.views.report.measured_parts import read_sweep
        from taxel.views.report.versions_part import Adapted

        tables = {path.name: _read(path) for path in self.tables}
        audits = [read_audit(_read(path), path.name) for path in self.audited]
        sweeps = {path.name: read_sweep(_read(path), path.name) for path in self.sweep}
        logs = zip(_names(self.reactions, "log"), self.reactions, strict=True)
        reactions = {name.removesuffix(".trials.csv"): read_trial_log(path) for name, path in logs}
        paths = dict(zip(_names(self.runs), self.runs, strict=True))
        with progress() as bar:
            task = bar.add_task("starting", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            runs: dict[str, Run] = {}
            latencies = {}
            adapted = {}
            for name, path in paths.items():
                on_step(f"run · {name}")
                runs[name] = load_run(path, weights=False)
                history = read_history(path)
                if len(history.versions) > 1:
                    adapted[name] = Adapted(history, _accuracies(path, history))
                if self.latency and (path / "weights-0.safetensors").exists():
                    on_step(f"latency · {name}")
                    latencies[name] = time_run(load_run(path))
            if self.audit:
                audits += self._audits(runs, paths, on_step)
            card = self._card(runs, on_step)
            write_run_report(
                output,
                RunPage(
                    runs=runs,
                    card=card,
                    adapted=adapted,
                    audits=audits,
                    latencies=latencies,
                    sweeps=sweeps,
                    reactions=reactions,
                    tables=tables,
                    made=Provenance.now(),
                ),
            )
        if self.data is not None and card is not None:
            self._note_others(runs, card)

    def _note_others(self, runs: Mapping[str, Run], card: DataCard) -> None:
        """Say which runs were trained on other recordings than those of --data."""
        others = [name for name, run in runs.items() if run.contract.data_digest != card.digest]
        if others:
            say_aside(
                f"note: {self.data} holds other recordings than those of {visible_names(others)}; "
                "the page's data card describes what it holds"
            )

    def _card(self, runs: dict[str, Run], on_step: Callable[[str], None]) -> DataCard | None:
        """Read the recordings; None where the runs' own are not at hand."""
        from taxel.evaluation.cards.data import data_card

        if self.data is not None:
            return data_card(self.data, on_step)
        first = next(iter(runs.values()), None)
        if first is None or not Path(first.data).exists():
            return None
        return data_card(Path(first.data), on_step)

    def _audits(
        self, runs: dict[str, Run], paths: dict[str, Path], on_step: Callable[[str], None]
    ) -> list[Audit]:
        """Audit each data set, target and split once."""
        from taxel.evaluation.audit.of_run import audit_run

        found: dict[tuple[str, str, str], Audit] = {}
        for name, run in runs.items():
            split = run.predictions.split if run.predictions is not None else ""
            kind = (run.contract.data_digest, run.contract.target, split)
            data = self.data or Path(run.data)
            if not data.exists():
                raise BadInput("the recordings, to audit them", f"no {data}", "name --data FOLDER")
            if kind not in found:
                on_step(f"audit · {name}")
                found[kind] = audit_run(run, data, paths[name], on_step)
        return list(found.values())


def _names(paths: tuple[Path, ...], what: str = "run") -> list[str]:
    """Return a short name for each path: its own, or the whole where two are called alike."""
    names = [path.resolve().name for path in paths]
    chosen = [n if names.count(n) == 1 else str(p) for n, p in zip(names, paths, strict=True)]
    if len(set(chosen)) < len(chosen):
        raise BadInput(f"each {what} once", f"{', '.join(chosen)}", "leave the second out")
    return chosen


def _accuracies(path: Path, history: History) -> dict[int, Mapping[str, float]]:
    """Return what versions of a run were found to be worth, those that are kept and were tested."""
    from taxel.bundles.versions import kept_path
    from taxel.training.run import load_run

    places = {
        version.number: path
        if version.number == history.current
        else kept_path(path, version.number)
        for version in history.versions
    }
    return {
        number: load_run(place, weights=False).contract.accuracy
        for number, place in places.items()
        if (place / "run.json").exists()
    }


def _read(path: Path) -> Any:
    try:
        return read_json(path)
    except (OSError, BadFile) as error:
        got = getattr(error, "got", "")
        if isinstance(error, OSError):
            got = (error.strerror or "none").lower()
        raise BadInput(
            f"JSON in {path}", got, "write it again with: taxel … --json > FILE.json"
        ) from error
