"""A self-contained HTML page of results: tables, figures, data, commands.

No script, no link to another file. Knows nothing about how results were made.
"""

from __future__ import annotations

import base64
import html
import math
import os
import platform
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import __version__
from taxel.evaluation.checked import Checked
from taxel.evaluation.teng_table import PUBLISHED, ROWS, Section
from taxel.recordings.reader import list_recordings, read_recording
from taxel.signals import Mark
from taxel.views import figures
from taxel.views.results import HEADINGS, with_interval
from taxel.windows.config import GATE_V, TENG_WINDOW
from taxel.windows.windower import cut_windows

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:1080px;margin:2rem auto;padding:0 1rem;
color:#1b1f24}
table{border-collapse:collapse;margin:.6rem 0 1.4rem;font-size:13px;
font-variant-numeric:tabular-nums}
th,td{padding:.2rem .6rem;border-bottom:1px solid #dde1e6;text-align:right;white-space:nowrap}
th:first-child,td:first-child{text-align:left}thead th{border-bottom:2px solid #8894a3}
.published,.trivial{color:#697485}.leaks{background:#fff3cd;padding:.1rem .4rem;border-radius:4px}
figure{margin:1rem 0}img{max-width:100%}figcaption,small{color:#566170}
code{background:#f0f2f5;padding:.1rem .3rem;border-radius:3px}
@media(prefers-color-scheme:dark){body{background:#15181c;color:#e4e7eb}code{background:#272c33}
th,td{border-color:#343b44}.leaks{background:#5c4a12}img{background:#fff;border-radius:4px}}
"""


def write_teng_report(path: Path, sections: list[Section], folders: dict[str, Path]) -> None:
    """Write the page of Table 4.1, whole or not at all.

    Args:
        path: The file to write.
        sections: What `teng_table` gave.
        folders: Preset → its recordings, for the pictures of the signal.
    """
    parts = [
        "<h1>Table 4.1 of the TENG hand, ours beside the published values</h1>",
        "<p>Balapan, thesis, 2025. The thesis splits windows at random; here every result is "
        "also given with whole sessions held out. Read both: the distance between them is what "
        "a split by windows hides. Grey dots are trivial baselines that see no touch, or "
        "hardly any; a network that does not clear them has learned little.</p>",
    ]
    for preset, folder in folders.items():
        parts.append(_signal(preset, folder))
    for section in sections:
        parts.append(_section(section))
    command = "taxel evaluate teng-table --html FILE"
    _write(path, "taxel: Table 4.1", parts, command)


def write_checked_report(path: Path, checked: Checked) -> None:
    """Write the page of one recipe's cross-validation, whole or not at all."""
    dataset, pooled = checked.dataset, checked.pooled
    classes = dataset.classes(checked.recipe.target)
    rows = {checked.recipe.model: pooled, **checked.bars}
    body = "".join(
        f"<tr><td>{_text(name)}</td><td>{with_interval(result)}</td>"
        f"<td>{result.trial_accuracy:.4f}</td><td>{result.scores.loss:.4f}</td>"
        f"<td>{result.scores.f1:.4f}</td></tr>"
        for name, result in rows.items()
    )
    trivial = "".join(
        f'<tr class="trivial"><td>{_text(name)}</td><td>{value:.4f}</td><td></td><td></td>'
        "<td></td></tr>"
        for name, value in checked.trivial.items()
    )
    parts = [
        f"<h1>{_text(checked.recipe.target)}, split: {_split(pooled.split)}</h1>",
        f"<p>{len(dataset)} windows of {dataset.config.steps} × {len(dataset.sensor.channels)} "
        f"in {len(dataset.trials)} trials; data {dataset.digest[:12]}. "
        + " ".join(f"{_text(note)}." for note in dataset.notes)
        + "</p>",
        "<table><thead><tr><th>model</th><th>accuracy, windows [95 %]</th><th>trials</th>"
        f"<th>loss</th><th>F1</th></tr></thead><tbody>{body}{trivial}</tbody></table>",
        _figure(
            figures.confusion(classes, pooled.scores.confusion, checked.recipe.model),
            "Confusion of all test windows.",
        ),
    ]
    command = f"taxel evaluate FOLDER --split {pooled.split!r} --html FILE"
    _write(path, f"taxel: {checked.recipe.target}", parts, command)


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
    head = f"<h2>The signal, preset {_text(preset)}</h2>"
    lines = "".join(_figure(chart, "One grasp; all sensors.") for chart in charts)
    image = figures.intensity_maps(maps, "V")
    return head + lines + _figure(image, "One 12 × 12 window of each class, as the 2D CNN sees it.")


def _inside(mark: Mark, time_s: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (time_s >= mark.start_s) & (time_s <= mark.end_s)


def _section(section: Section) -> str:
    models = list(section.columns)
    head = "".join(
        (f'<th class="published">{HEADINGS[m]}<br>published</th>' if m in PUBLISHED else "")
        + f"<th>{_text(HEADINGS.get(m, m))}</th>"
        for m in models
    )
    rows = "".join(
        f"<tr><td>{row}</td>"
        + "".join(
            (f'<td class="published">{PUBLISHED[m][row]:.4f}</td>' if m in PUBLISHED else "")
            + f"<td>{_number(section.columns[m].rows[row])}</td>"
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
        _figure(
            figures.confusion(
                section.classes, section.columns[m].pooled.scores.confusion, HEADINGS.get(m, m)
            ),
            "",
        )
        for m in models
    )
    about = f"{section.task}, preset {section.preset}, split: {_split(section.split)}"
    return (
        f"<h2>{about}</h2><p>{section.windows} windows.</p>"
        f"<table><thead><tr><th>metric</th>{head}</tr></thead><tbody>{rows}</tbody></table>"
        + _figure(
            figures.accuracies(names, values, intervals, "accuracy over all folds"),
            "Blue: models with 95 % intervals, whole sessions resampled. Grey: trivial baselines.",
        )
        + f'<div style="display:flex;flex-wrap:wrap;gap:1rem">{matrices}</div>'
    )


def _write(path: Path, title: str, parts: list[str], command: str) -> None:
    packages = ", ".join(f"{name} {version(name)}" for name in ("torch", "numpy", "onnxruntime"))
    foot = (
        f"<h2>How this was made</h2><p><code>{_text(command)}</code></p><p><small>taxel "
        f"{__version__}, Python {platform.python_version()}, {packages}, "
        f"{platform.machine()}, {os.cpu_count()} cores.</small></p>"
    )
    page = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{_text(title)}</title>'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<style>{_STYLE}</style><body>{''.join(parts)}{foot}</body></html>\n"
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(page, encoding="utf-8")
    os.replace(temporary, path)


def _figure(png: bytes, caption: str) -> str:
    data = base64.b64encode(png).decode()
    return (
        f'<figure><img alt="{_text(caption)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{_text(caption)}</figcaption></figure>"
    )


def _split(name: str) -> str:
    return f'<span class="leaks">{_text(name)}</span>' if "leaks" in name else _text(name)


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.4f}"


def _text(text: str) -> str:
    return html.escape(text)
