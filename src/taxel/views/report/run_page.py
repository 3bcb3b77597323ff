"""The page of `taxel report`: everything that must stand beside an accuracy, in one file.

Knows nothing about how results were made or measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

from taxel.errors import BadInput
from taxel.evaluation.audit.finding import Audit
from taxel.evaluation.cards.data import DataCard
from taxel.evaluation.cards.latency import NetworkLatency
from taxel.evaluation.paired import compare_runs
from taxel.evaluation.run_scores import RunScores, judge
from taxel.recordings.trial_log import GraspTrial
from taxel.training.environment import Provenance
from taxel.training.run import Run
from taxel.views.report.audit_part import audit_part
from taxel.views.report.data_part import card_of_recordings, card_of_run, drawn_split
from taxel.views.report.measured_parts import (
    SweepPoint,
    environment_part,
    latency_part,
    sweep_part,
)
from taxel.views.report.page import (
    Html,
    colour,
    join,
    percent,
    section,
    split_name,
    tag,
    text,
    tiles,
    write_page,
)
from taxel.views.report.person_part import person_part
from taxel.views.report.result_parts import accuracies, comparison, each_run, published_beside
from taxel.views.report.saved_parts import saved_part
from taxel.views.report.versions_part import Adapted, versions_part
from taxel.windows.config import TENG_WINDOW


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPage:
    """What stands on a page."""

    runs: Mapping[str, Run] = field(default_factory=dict)
    """Name → run, with predictions or without."""
    card: DataCard | None = None
    """Of the recordings; None where they are not at hand."""
    adapted: Mapping[str, Adapted] = field(default_factory=dict)
    """Run that was adapted → its versions."""
    audits: Sequence[Audit] = ()
    latencies: Mapping[str, NetworkLatency] = field(default_factory=dict)
    sweeps: Mapping[str, Sequence[SweepPoint]] = field(default_factory=dict)
    """File → robustness curves."""
    reactions: Mapping[str, Sequence[GraspTrial]] = field(default_factory=dict)
    """Log → its grasps."""
    tables: Mapping[str, Any] = field(default_factory=dict)
    """File → parsed JSON of `taxel reproduce`."""
    made: Provenance = Provenance()  # noqa: RUF009  # frozen
    """How this page is made."""


def write_run_report(path: Path, page: RunPage) -> None:
    """Write the page, whole or not at all.

    Raises:
        BadInput: A saved result is of no known kind.
        RecordingFailed: The disk refused.
    """
    judged = {
        name: judge(run.predictions)
        for name, run in page.runs.items()
        if run.predictions is not None
    }
    parts = _sections(page, judged)
    title = _title(page)
    links = join(
        [Html(f'<a href="#{text(name)}">{text(heading)}</a>') for name, heading, _ in parts]
    )
    head = join([tag("h1", title), _tiles(page, judged), tag("nav", links)])
    write_page(
        path,
        f"taxel: {title}",
        [head, *(section(name, heading, [inside]) for name, heading, inside in parts)],
    )


def _title(page: RunPage) -> str:
    targets = dict.fromkeys(run.contract.target for run in page.runs.values())
    if targets:
        return f"Predicted from touch: {' and '.join(targets)}"
    titles = [saved_part(data, name)[0] for name, data in page.tables.items()]
    return titles[0] if len(titles) == 1 else "Results"


def _tiles(page: RunPage, judged: Mapping[str, RunScores]) -> Html:
    figures = [
        (percent(own.scores.accuracy), f"{name}, {_split(page.runs[name])}")
        for name, own in judged.items()
    ]
    figures += [
        (
            percent(result.now.change.after["all"]),
            f"{name}, version {result.now.number}, when adapted",
        )
        for name, result in page.adapted.items()
        if name not in judged and "all" in result.now.change.after
    ]
    trivial = [(value, name) for run in page.runs.values() for name, value in run.trivial.items()]
    if trivial:
        value, name = max(trivial)
        figures.append((percent(value), f"best baseline: {name}"))
    figures += [
        (f"{1000 * latency.median_ms:,.0f} µs", f"{name}, median latency of a window")
        for name, latency in page.latencies.items()
    ]
    return tiles(figures) if figures else Html("")


def _split(run: Run) -> str:
    return run.predictions.split if run.predictions is not None else ""


def _sections(page: RunPage, judged: Mapping[str, RunScores]) -> list[tuple[str, str, Html]]:
    """Return (link, heading, inside) of each part that there is something for."""
    parts: list[tuple[str, str, Html]] = []
    first = next(iter(page.runs.values()), None)
    inks = {name: colour(index) for index, name in enumerate(page.runs)}
    if page.card is not None:
        parts.append(("data", "Data", card_of_recordings(page.card, first)))
    elif first is not None:
        parts.append(("data", "Data", card_of_run(first)))
    alike = _alike(page.runs)
    if alike:
        drawn = [drawn_split(run.predictions) for (run, *_) in
                 (list(own.values()) for own in alike) if run.predictions is not None]  # fmt: skip
        parts.append(("split", "Split", join(drawn)))
    if page.audits:
        audits = [
            join([tag("h3", split_name(audit.split)) if audit.split else "", audit_part(audit)])
            for audit in page.audits
        ]
        parts.append(("audit", "Audit", join(audits)))
    if alike:
        inside = [accuracies(own, judged, inks) for own in alike]
        inside.append(published_beside({n: r for n, r in page.runs.items() if n in judged}, judged))
        parts.append(("results", "Results", join(inside)))
    if page.adapted:
        shown = [join([tag("h3", name) if len(page.runs) > 1 else "", versions_part(result)])
                for name, result in page.adapted.items()]  # fmt: skip
        parts.append(("versions", "Versions", join(shown)))
    pairs = _pairs(alike)
    if pairs:
        parts.append(("comparison", "Comparison", join(pairs)))
    if judged:
        each = [each_run(name, page.runs[name], own, inks[name]) for name, own in judged.items()]
        parts.append(("runs", "Each run", join(each)))
    parts += [
        (f"saved-{index}", *saved_part(data, name))
        for index, (name, data) in enumerate(page.tables.items(), 1)
    ]
    if page.sweeps:
        curves = [
            join([tag("h3", name) if len(page.sweeps) > 1 else "", sweep_part(points)])
            for name, points in page.sweeps.items()
        ]
        parts.append(("robustness", "Robustness", join(curves)))
    if page.reactions:
        parts.append(("person", "The person in the loop", person_part(page.reactions)))
    if page.latencies:
        hand = any(run.contract.window == TENG_WINDOW for run in page.runs.values())
        parts.append(("latency", "Latency", latency_part(page.latencies, hand)))
    made = {name: run.made for name, run in page.runs.items()} | {"this page": page.made}
    parts.append(("made", "How this was made", environment_part(made)))
    return parts


def _alike(runs: Mapping[str, Run]) -> list[dict[str, Run]]:
    """Return runs with predictions, those of one data set, target and split together."""
    found: dict[tuple[str, str, str], dict[str, Run]] = {}
    for name, run in runs.items():
        if run.predictions is not None:
            kind = (run.contract.data_digest, run.contract.target, run.predictions.split)
            found.setdefault(kind, {})[name] = run
    return list(found.values())


def _pairs(alike: Sequence[Mapping[str, Run]]) -> list[Html]:
    """Return each two runs compared; runs that were not tested alike are said to be so."""
    parts = []
    for own in alike:
        for (first, scored), (second, other) in combinations(own.items(), 2):
            try:
                parts.append(comparison(compare_runs(scored, other), first, second))
            except BadInput as error:
                parts.append(tag("p", f"{second} against {first}: {error}", "note"))
    return parts
