"""What a result rests on: the data card, and the split drawn.

Knows nothing about accuracies.
"""

from __future__ import annotations

import numpy as np

from taxel.evaluation.cards.data import DataCard, trial_counts
from taxel.evaluation.run_scores import split_groups
from taxel.name_order import counting_order
from taxel.plain_text import number_of
from taxel.training.predictions import Predictions
from taxel.training.run import Run
from taxel.views.report.charts import strip
from taxel.views.report.page import Html, join, key, split_name, table, tag, text

_WIDE = 30
"""Groups side by side in a drawn split; more are left to the recordings' own list."""
_LONG = 6
"""Letters beyond which headings of a drawn split stand upright."""


def card_of_recordings(card: DataCard, run: Run | None) -> Html:
    """Return the data card; beside a run it says whether these are the run's recordings."""
    rows: list[tuple[object, object]] = [
        ("recordings", f"{card.recordings}, {card.hours:.2f} hours, {card.megabytes:.1f} MB"),
        ("written by", card.written),
        *card.sensors.items(),
        *((f"sensor: {name}", value) for name, value in card.details.items()),
        *((f"label {name}", _counts(counts)) for name, counts in card.classes.items()),
        *((f"group {name}", f"{count} different") for name, count in card.groups.items()),
        ("lost", card.lost),
    ]
    if card.digest:
        rows.append(("digest (SHA-256)", tag("code", card.digest)))
    if run is not None:
        rows += _used(run)
    parts = [_same_data(card, run) if run is not None else "", table([], rows, kind="words")]
    if card.nuisances:
        parts += [
            tag("p", "What changed from recording to recording, as their manifests say:"),
            table(
                ["nuisance", "least", "median", "most", "each recording"],
                [
                    [
                        nuisance.name,
                        f"{min(nuisance.values):g}",
                        f"{np.median(nuisance.values):g}",
                        f"{max(nuisance.values):g}",
                        strip(nuisance.values),
                    ]
                    for nuisance in card.nuisances
                ],
            ),
        ]
    return join(parts)


def card_of_run(run: Run) -> Html:
    """Return a data card from the run alone, where the recordings are not at hand."""
    contract, found = run.contract, run.predictions
    units = ", ".join(sorted(set(contract.units)))
    rows: list[tuple[object, object]] = [
        ("recordings", f"not at hand ({run.data}): only what the run kept is shown"),
        (
            "sensor",
            f"{number_of(len(contract.channels), 'channel')} in {units}, {contract.rate_hz:g} "
            "scans/s",
        ),
    ]
    if found is not None:
        hours = sum(trial.duration_s for trial in found.trials) / 3600.0
        rows.append(("trials", f"{len(found.trials)}, {hours:.2f} hours in all"))
        rows += [
            (f"group {name}", f"{len({t.groups[name] for t in found.trials})} different")
            for name in split_groups(found)
        ]
    rows.append(("digest (SHA-256)", tag("code", contract.data_digest)))
    return table([], rows + _used(run), kind="words")


def drawn_split(predictions: Predictions) -> Html:
    """Return which groups stand on which side of each fold, a drawing for each group."""
    keys = [
        key_
        for key_ in split_groups(predictions)
        if len({trial.groups[key_] for trial in predictions.trials}) <= _WIDE
    ]
    legend = key(
        [
            ("color-mix(in srgb,var(--c0) 16%,transparent)", "trained on"),
            ("var(--c1)", "tested (windows)"),
            (
                "linear-gradient(135deg,color-mix(in srgb,var(--c1) 60%,var(--page)) 50%,"
                "color-mix(in srgb,var(--c0) 40%,var(--page)) 50%)",
                "both sides",
            ),
        ]
    )
    tested = (
        f"{number_of(len(predictions), 'test window', ',')} in "
        f"{number_of(len(set(predictions.trial.tolist())), 'trial')}."
    )
    parts: list[object] = [
        tag("h3", split_name(predictions.split)),
        tag("p", f"{len(predictions.folds)} fold{'s' * (len(predictions.folds) > 1)}, {tested}"),
    ]
    parts += [_sides(predictions, name) for name in keys]
    shared = {name: _on_both(predictions, name) for name in [*keys, "trial"]}
    if keys:
        parts.append(tag("p", legend))
    shared_groups = [f"{name} ({count} of {of})" for name, (count, of) in shared.items() if count]
    if shared_groups:
        parts.append(
            tag(
                "p",
                f"On both sides of a fold: {', '.join(shared_groups)}. Accuracy under this split "
                "says nothing about others than those.",
                "note leaks" if shared["trial"][0] else "note",
            )
        )
    else:
        parts.append(tag("p", "No group above stands on both sides of any fold.", "note"))
    return join(parts)


def _sides(found: Predictions, name: str) -> Html:
    values = np.array([trial.groups[name] for trial in found.trials])
    columns = sorted(set(values.tolist()), key=counting_order)
    names = [_tail(column, columns) for column in columns]
    kind = "tall" if max(map(len, names)) > _LONG else ""
    head = join([tag("th", name, kind) for name in names])
    rows = []
    for index, fold in enumerate(found.folds):
        tested = np.bincount(found.trial[found.fold == index], minlength=len(found.trials))
        cells = [
            _side(int(found.trained[index][values == c].sum()), int(tested[values == c].sum()))
            for c in columns
        ]
        rows.append(f"<tr><th>{text(fold)}</th>{''.join(cells)}</tr>")
    return Html(
        f'<div class="scroll"><table class="sides"><thead><tr><th>by {text(name)}</th>{head}</tr>'
        f"</thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _side(trained: int, tested: int) -> str:
    kind = "both" if trained and tested else "test" if tested else "train" if trained else ""
    count = str(tested) if tested else ""
    return f'<td class="{kind}" title="{trained} trained on, {tested} tested">{count}</td>'


def _on_both(found: Predictions, name: str) -> tuple[int, int]:
    """Return how many groups stand on both sides of some fold, of how many."""
    values = np.array([trial.groups[name] for trial in found.trials])
    both: set[str] = set()
    for index in range(len(found.folds)):
        tested = np.bincount(found.trial[found.fold == index], minlength=len(values)) > 0
        both |= set(values[tested]) & set(values[found.trained[index] > 0])
    return len(both), len(set(values))


def _used(run: Run) -> list[tuple[object, object]]:
    contract, found = run.contract, run.predictions
    window = contract.window
    grid = f"{window.grid_hz:g} Hz grid" if window.grid_hz else "the sensor's own scans"
    gate = "no gate" if window.gate is None else f"gate {window.gate:g} {contract.units[0]}"
    rows: list[tuple[object, object]] = [
        (
            "windows",
            f"{number_of(window.steps, 'row')} × "
            f"{number_of(len(contract.channels), 'channel')}, stride {window.stride}, "
            f"{grid}, {gate}",
        )
    ]
    if found is not None:
        counts = trial_counts(found.trials, contract.target)
        rows.append((f"trials that gave windows, by {contract.target}", _counts(counts)))
    return rows


def _same_data(card: DataCard, run: Run) -> Html:
    if card.digest == run.contract.data_digest:
        return Html("")
    return tag(
        "p",
        f"These recordings are not those of the run: their digest begins {card.digest[:12]}, "
        f"the run's {run.contract.data_digest[:12]}.",
        "note leaks",
    )


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def _tail(name: str, names: list[str]) -> str:
    """Return a name without what all names begin with, up to a mark such as "-"."""
    head = names[0]
    while head and not all(name.startswith(head) for name in names):
        head = head[:-1]
    cut = max(head.rfind(mark) for mark in "-_/ ") + 1
    return name[cut:] or name
