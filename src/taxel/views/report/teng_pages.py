"""Pages of Table 4.1 and of one recipe's cross-validation: tables, figures, commands.

Knows nothing about how results were made.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.checked import Checked
from taxel.evaluation.teng.table_4_1 import PUBLISHED, ROWS, Section
from taxel.plain_text import number_of
from taxel.recordings.reader import list_recordings, read_recording
from taxel.signals import Mark
from taxel.training.environment import Provenance
from taxel.views.figures import plots as figures
from taxel.views.report.page import Html, number, png_figure, split_name, text, write_page
from taxel.views.tables.results import HEADINGS, with_interval
from taxel.windows.config import GATE_V, TENG_WINDOW
from taxel.windows.windower import cut_windows


def write_teng_report(path: Path, sections: list[Section], folders: dict[str, Path]) -> None:
    """Write the page of Table 4.1, whole or not at all.

    Args:
        path: The file to write.
        sections: What `teng_table` gave.
        folders: Preset → its recordings, for the pictures of the signal.
    """
    parts = [
        "<h1>Table 4.1 of the TENG hand, ours beside the published values</h1>",
        "<p>Balapan, thesis, 2025. The thesis names no split; its figures fit windows split at "
        "random (decision 42), and the preset paper, one session a class, is our reading. Here "
        "every result is "
        "also given with whole sessions held out. Read both: the distance between them is what "
        "a split by windows hides. Grey dots are baselines that see no touch, hardly "
        "any, or only channel means; a network below them has learned little.</p>",
    ]
    for preset, folder in folders.items():
        parts.append(_signal(preset, folder))
    for section in sections:
        parts.append(_section(section))
    _write(path, "taxel: Table 4.1", parts)


def write_checked_report(path: Path, checked: Checked) -> None:
    """Write the page of one recipe's cross-validation, whole or not at all."""
    dataset, pooled = checked.dataset, checked.pooled
    classes = dataset.classes(checked.recipe.target)
    rows = {checked.recipe.model: pooled, **checked.bars}
    body = "".join(
        f"<tr><td>{text(name)}</td><td>{with_interval(result)}</td>"
        f"<td>{result.trial_accuracy:.4f}</td><td>{result.scores.loss:.4f}</td>"
        f"<td>{result.scores.f1:.4f}</td></tr>"
        for name, result in rows.items()
    )
    trivial = "".join(
        f'<tr class="trivial"><td>{text(name)}</td><td>{value:.4f}</td><td></td><td></td>'
        "<td></td></tr>"
        for name, value in checked.trivial.items()
    )
    parts = [
        f"<h1>{text(checked.recipe.target)}, split: {split_name(pooled.split)}</h1>",
        f"<p>{number_of(len(dataset), 'window')} of {dataset.config.steps} × "
        f"{len(dataset.sensor.channels)} "
        f"in {number_of(len(dataset.trials), 'trial')}; data {dataset.digest[:12]}. "
        + " ".join(f"{text(note)}." for note in dataset.notes)
        + "</p>",
        "<table><thead><tr><th>model</th><th>accuracy, windows [95 %]</th><th>trials</th>"
        f"<th>loss</th><th>F1</th></tr></thead><tbody>{body}{trivial}</tbody></table>",
        png_figure(
            figures.confusion(classes, pooled.scores.confusion, checked.recipe.model),
            "Confusion of all test windows.",
        ),
    ]
    _write(path, f"taxel: {checked.recipe.target}", parts)


def _signal(preset: str, folder: Path) -> str:
    """Return line charts and intensity maps of one grasp of each class."""
    charts: list[bytes] = []
    maps: dict[str, NDArray[np.float32]] = {}
    seen: set[str] = set()
    drawn: set[str] = set()
    for file in list_recordings(folder):
        recording = read_recording(file)
        samples, sensor = recording.samples, recording.manifest.sensor
        for mark in recording.marks:
            name = f"{mark.labels['shape']}, {mark.labels['material']}"
            inside = _inside(mark, samples.fitted_s)
            if name in seen or not inside.any():
                continue
            part = samples[inside]
            windows = cut_windows(part, TENG_WINDOW, sensor)
            if not len(windows):
                continue
            seen.add(name)
            if mark.labels["shape"] not in drawn and len(charts) < 3:
                drawn.add(mark.labels["shape"])
                time_s = part.fitted_s - part.fitted_s[0]
                charts.append(
                    figures.traces(time_s, part.values, sensor.channels, "V", name, GATE_V)
                )
            if len(maps) < 9:
                maps[name.replace(", ", "\n")] = windows.values[len(windows) // 2]
    if not maps:
        return ""
    head = f"<h2>The signal, preset {text(preset)}</h2>"
    lines = "".join(
        png_figure(chart, "One grasp of several presses; all sensors.") for chart in charts
    )
    image = figures.intensity_maps(maps, "V")
    return (
        head + lines + png_figure(image, "One 12 × 12 window of each class, as the 2D CNN sees it.")
    )


def _inside(mark: Mark, time_s: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (time_s >= mark.start_s) & (time_s <= mark.end_s)


def _section(section: Section) -> str:
    models = list(section.columns)
    head = "".join(
        (f'<th class="published">{HEADINGS[m]}<br>published</th>' if m in PUBLISHED else "")
        + f"<th>{text(HEADINGS.get(m, m))}</th>"
        for m in models
    )
    rows = "".join(
        f"<tr><td>{row}</td>"
        + "".join(
            (f'<td class="published">{PUBLISHED[m][row]:.4f}</td>' if m in PUBLISHED else "")
            + f"<td>{number(section.columns[m].rows[row])}</td>"
            for m in models
        )
        + "</tr>"
        for row in ROWS
    )
    names = [HEADINGS.get(m, m) for m in models] + list(section.trivial)
    pooled = [section.columns[m].pooled for m in models]
    values = [p.scores.accuracy for p in pooled] + list(section.trivial.values())
    intervals = [p.interval for p in pooled] + [(math.nan, math.nan)] * len(section.trivial)
    matrices = "".join(
        png_figure(
            figures.confusion(
                section.classes, section.columns[m].pooled.scores.confusion, HEADINGS.get(m, m)
            ),
            "",
        )
        for m in models
    )
    about = f"{section.task}, preset {section.preset}, split: {split_name(section.split)}"
    return (
        f"<h2>{about}</h2><p>{number_of(section.windows, 'window')}.</p>"
        f"<table><thead><tr><th>metric</th>{head}</tr></thead><tbody>{rows}</tbody></table>"
        + png_figure(
            figures.accuracies(names, values, intervals, "accuracy over all folds"),
            "Blue: models with 95 % intervals, whole sessions resampled. Grey: trivial baselines.",
        )
        + f'<div style="display:flex;flex-wrap:wrap;gap:1rem">{matrices}</div>'
    )


def _write(path: Path, title: str, parts: list[str]) -> None:
    how = Provenance.now()
    made = ", ".join(f"{name} {value}" for name, value in how.environment.items())
    command = f"<code>{text(how.command)}</code>" if how.command else (
        "made from Python, not by a command"
    )  # fmt: skip
    foot = f"<h2>How this was made</h2><p>{command}</p><p><small>{text(made)}.</small></p>"
    write_page(path, title, [Html("".join([*parts, foot]))])
