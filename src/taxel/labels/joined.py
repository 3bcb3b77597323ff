"""Labels that are predicted together: the target "a+b" is the values of a and b, with a blank.

A label that is itself called "a+b" is that label. Knows nothing about windows or models.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from taxel.errors import BadDataset
from taxel.labels.trials import Trial

Labels = Mapping[str, str]


def joined_label(labels: Labels, target: str) -> str | None:
    """Return the value that a target asks for; None where a label is missing.

    Args:
        labels: Of a trial or mark.
        target: A label, or several joined by "+"; a label of that very name comes first.
    """
    if target in labels:
        return labels[target]
    parts = target.split("+")
    if any(part not in labels for part in parts):
        return None
    return " ".join(labels[part] for part in parts)


def parts_of(target: str, labels: Iterable[Labels]) -> tuple[str, ...]:
    """Return the labels that a target is made of; itself where it is a label of its own.

    Args:
        target: A label, or several joined by "+".
        labels: Of each trial, with the joined one or without.
    """
    parts = tuple(target.split("+"))
    made = all(
        all(part in own for part in parts)
        and own.get(target, _values(own, parts)) == _values(own, parts)
        for own in labels
    )
    return parts if made else (target,)


def with_joined_label(trial: Trial, target: str) -> Trial:
    """Return the trial with "a+b" as a label where it has both; as it is otherwise."""
    value = joined_label(trial.labels, target)
    return trial if value is None else replace(trial, labels={**trial.labels, target: value})


def with_joined_labels(trials: Sequence[Trial], target: str, folder: Path) -> tuple[Trial, ...]:
    """Return trials as `with_joined_label` does, once it is found that no two values merge.

    Args:
        trials: Of one folder.
        target: A label, or several joined by "+".
        folder: Where the trials are from, for the message.

    Raises:
        BadDataset: See `refuse_merged`.
    """
    found = tuple(with_joined_label(trial, target) for trial in trials)
    made = [now for now, was in zip(found, trials, strict=True) if target not in was.labels]
    refuse_merged(made, target, folder)
    return found


def refuse_merged(trials: Sequence[Trial], target: str, folder: Path) -> None:
    """Refuse values that are joined to one text though they differ, such as a cup of glass.

    Args:
        trials: With the target's label where they have one.
        target: A label, or several joined by "+".
        folder: Where the trials are from, for the message.

    Raises:
        BadDataset: So it is.
    """
    known: dict[str, str] = {}
    for trial in trials:
        parts = parts_of(target, [trial.labels])
        if target not in trial.labels or len(parts) < 2:
            continue
        combination = ", ".join(f"{part} {trial.labels[part]!r}" for part in parts)
        value = trial.labels[target]
        if known.setdefault(value, combination) != combination:
            raise BadDataset(
                f"values of {target} that differ once they are joined by a blank",
                f"{known[value]} and {combination} in {folder}, both {value!r}",
                "rename a value, such as cup-glass for 'cup glass', and import again",
            )


def _values(labels: Labels, parts: Sequence[str]) -> str:
    return " ".join(labels[part] for part in parts)
