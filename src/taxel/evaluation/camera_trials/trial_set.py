"""Camera trials with one label, cut and looked at: what recognisers learn from and are judged on.

Knows nothing about splits, models or screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from taxel.errors import BadDataset
from taxel.evaluation.camera_trials.crossval import TrialSet
from taxel.labels.class_order import in_order
from taxel.training.camera_trials.features import further_crops, trial_rows
from taxel.windows.camera_trials import CameraTrial
from taxel.windows.trial_crops import USUAL
from taxel.windows.trial_layout import choose_layout, count_between

JUDGED: Final = "features of trials"
LEARNED: Final = "features of further crops, only learned from"
"""The passes over the trials."""


def load_trial_set(
    trials: Sequence[CameraTrial],
    target: str | None,
    cache: Path,
    *,
    crop: int | None = None,
    views: Sequence[str] = USUAL,
    further: bool = False,
    on_trial: Callable[[str, int, int], None] = lambda name, done, of: None,
) -> TrialSet:
    """Return trials with their label, cut and looked at.

    Args:
        trials: At least two.
        target: The label; the only one where there is one, unless given.
        cache: Folder for what is computed.
        crop: Frames in a crop; chosen by the shortest trial unless given.
        views: Names in `FAMILIES`.
        further: Whether there are crops that are only learned from, too.
        on_trial: Called with the pass over the trials, trials done and in all.

    Raises:
        BadDataset: A trial lacks the label, there is one class only, or cameras differ in size.
        BadInput: The crop does not fit.
    """
    target = target or _only_label(trials)
    lacking = [trial.name for trial in trials if target not in trial.labels]
    if lacking:
        known = sorted({name for trial in trials for name in trial.labels})
        raise BadDataset(
            f"the label {target!r} on every trial",
            f"none on {lacking[0]}{f' and {len(lacking) - 1} more' if lacking[1:] else ''}",
            f"labels are {', '.join(known) or 'none'}; name one with --target, or fill the table",
        )
    sizes = {(trial.width, trial.height) for trial in trials}
    if len(sizes) > 1:
        raise BadDataset("images of one size in all trials",
                         " and ".join(f"{w}×{h}" for w, h in sorted(sizes)[:3]),
                         "make a table of each size")  # fmt: skip
    labels = [trial.labels[target] for trial in trials]
    classes = in_order(set(labels))
    if len(classes) < 2:
        raise BadDataset(f"two or more classes of {target!r}", f"only {classes[0]!r}",
                         "record others too, or name another label with --target")  # fmt: skip
    lengths = [trial.frames for trial in trials]
    layout = choose_layout(lengths, crop)
    cut = trial_rows(trials, layout, views, cache, partial(on_trial, JUDGED))
    count = count_between(layout, len(trials)) if further else 0
    between = None
    if count:
        on_between = partial(on_trial, LEARNED)
        between = trial_rows(trials, layout, views, cache, on_between, between=count)
    return TrialSet(
        target=target,
        classes=classes,
        y=np.array([classes.index(label) for label in labels], np.intp),
        names=tuple(trial.name for trial in trials),
        groups=tuple(dict(trial.groups) for trial in trials),
        lengths=np.array(lengths, np.intp),
        cameras=len(trials[0].cameras),
        layout=layout,
        cut=cut,
        further=further_crops(cut, between) if further else None,
    )


def _only_label(trials: Sequence[CameraTrial]) -> str:
    known = sorted(set.intersection(*(set(trial.labels) for trial in trials)))
    if len(known) == 1:
        return known[0]
    raise BadDataset(
        "one label to predict", f"{len(known)} on every trial: {', '.join(known) or 'none'}",
        "name one with --target",
    )  # fmt: skip
