"""What the verbs for camera trials share: their data, target and split.

Knows nothing about models.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from taxel.cli.long_work import LongWork
from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import say_aside
from taxel.errors import BadInput
from taxel.plain_text import number_of

if TYPE_CHECKING:
    from taxel.evaluation.camera_trials.cut_choice import CutTrials
    from taxel.evaluation.camera_trials.sides import TrialSplit
    from taxel.evaluation.camera_trials.trial_set import LabelledTrials
    from taxel.training.camera_trials.image_network import ImageNetwork
    from taxel.windows.camera_trials import CameraTrial


@dataclass(frozen=True, kw_only=True)
class TrialOptions:
    """Which trials, which label, and which of them are tested."""

    target: str | None = None
    """The label to predict; needed only where the data have more than one."""
    split: str | None = None
    """Which trials are tested: group:KEY (held out in turn), order:KEY:LAST, order:KEY:70% (those
    after the first 70 %; with :by-class behind it of each class), random, or split for the column
    of that name, which is the default where it names test trials."""
    fold_count: int = 5
    """How many folds, where groups are held out in turn."""
    folds: Path | None = None
    """A table of folds (CSV: recording or group:KEY, fold or side) instead of --split."""
    test: Path | None = None
    """Further trials, used only for testing: a table, or a folder of recordings."""
    crop: int | None = None
    """Images in a crop; as many as the shortest trial has, at most 48, unless given."""
    part: Literal["whole", "moving"] | None = None
    """Take a trial's crops from the whole of it, or, at about 25 images a second, from the part in
    which something moves, so that rest before and after the touch is left out. Inner folds choose
    unless given."""
    touch: bool = False
    """Use features of the touch encoder too; all of its extra work takes about 2 ms for each
    image."""
    network: bool = True
    """Look at eight images of each crop through an image network, too (EfficientNet-Lite0, trained
    on ImageNet), which recognises textures and shapes wherever they lie: about 15 ms an image on
    one core. A bundle that needs the network is 7 MB larger."""
    cache: Path | None = None
    """Folder for features; $TAXEL_CACHE or ~/.cache/taxel unless given."""
    seed: int = 0
    """Seed of folds and models."""
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)

    def load(
        self, data: Path, work: LongWork, *, folds: bool = True, final: bool = False
    ) -> tuple[CutTrials, TrialSplit, list[CameraTrial]]:
        """Read, cut and look at the trials; return them, how they are parted, and their images.

        Args:
            data: A table or a folder of recordings.
            work: What shows progress.
            folds: Whether models are tested: a training side for each fold.
            final: Whether a recogniser is kept: one more side, the last.

        Raises:
            BadInput: The options or trials do not allow it.
        """
        from taxel.evaluation.camera_trials.cut_choice import (
            choose_cuts,
            completed,
            load_ways,
            training_sides,
        )
        from taxel.evaluation.camera_trials.other_sessions import others_to_come
        from taxel.evaluation.camera_trials.trial_set import Sight, with_extras
        from taxel.training.frames.features import default_cache
        from taxel.windows.trial_crops import USUAL

        labelled, split, found = self.read_and_part(data, work)
        cache = self.cache or default_cache()
        sight = Sight(
            views=(*USUAL, *(("touch",) if self.touch else ())),
            network=self._network(),
            extras=True,
            asked=others_to_come(labelled, split, self.seed),
        )
        moving = None if self.part is None else self.part == "moving"
        ways = load_ways(
            found, labelled.target, cache,
            crop=self.crop, sight=sight, moving=moving, on_trial=work.at,
        )  # fmt: skip
        sides = training_sides(labelled, split, folds=folds, final=final)
        cut = choose_cuts(ways, split, sides, self.seed, partial(work.step, "choosing"))
        return (
            completed(cut, lambda own: with_extras(own, found, cache, sight, work.at)),
            split,
            found,
        )

    def read_and_part(
        self, data: Path, work: LongWork
    ) -> tuple[LabelledTrials, TrialSplit, list[CameraTrial]]:
        """Read the trials; return their labels, how they are parted, and their images.

        Raises:
            BadInput: The options or trials do not allow it.
        """
        from taxel.evaluation.camera_trials.trial_set import labelled_trials

        self._check()
        work.step("reading trials", "reading trials")
        found = self._read(data)
        labelled = labelled_trials(found, self.target)
        return labelled, self._split(labelled), found

    def _network(self) -> ImageNetwork | None:
        from taxel.training.camera_trials.image_network import find_image_network

        if not self.network:
            return None
        if (found := find_image_network()) is None:
            say_aside(
                "note: no trained image network is installed, so trials are judged without one: "
                "pip install 'taxel[train]' brings it; --no-network leaves it out without a note"
            )
        return found

    def _check(self) -> None:
        if not 0 <= self.seed < 2**31:
            raise BadInput("a --seed of at least 0", str(self.seed), "choose another")
        given = [name for name in ("split", "folds", "test") if getattr(self, name) is not None]
        if len(given) > 1:
            raise BadInput("one way to part the trials", " and ".join(f"--{n}" for n in given),
                           "leave the others out")  # fmt: skip

    def _read(self, data: Path) -> list[CameraTrial]:
        from taxel.recordings.imports.video_rows import SPLIT, TEST
        from taxel.windows.camera_trials import check_order, read_camera_trials

        trials = read_camera_trials(data)
        if same := [names for names in _alike(trials).values() if len(names) > 1]:
            more = f", and in {number_of(len(same) - 1, 'more such set')}" if same[1:] else ""
            say_aside(
                f"warning: the same images in {' and '.join(same[0])}"
                f"{more}: where a split parts them, what is tested was learned from"
            )
        if self.test is None:
            return trials
        others = read_camera_trials(self.test)
        check_order([*trials, *others])
        # A recording's own images are compared with those that an import makes of files.
        mixed = {trial.recorded for trial in (*trials, *others)} == {True, False}
        known = {own: trial.name for trial in trials for own in _digests(trial, mixed)}
        for trial in others:
            own_digests = _digests(trial, mixed, turned=True)
            if twin := next((own for own in own_digests if own in known), None):
                raise BadInput(
                    "other trials to test on than to train on",
                    f"{trial.name} in {self.test}, which holds the images of {known[twin]}",
                    "take it out of one of the two",
                )
        return [
            replace(trial, groups={**trial.groups, SPLIT: side})
            for side, part in (("train", trials), (TEST, others))
            for trial in part
        ]

    def _split(self, trials: LabelledTrials) -> TrialSplit:
        from taxel.evaluation.camera_trials.sides import left_out, split_by_table, split_trials

        if self.folds is not None:
            split = split_by_table(
                trials.names, trials.groups, trials.y, self.folds, trials.classes
            )
            if note := left_out(split, len(trials.names)):
                say_aside(f"note: {note}")
            return split
        return split_trials(
            trials.groups, trials.y, self.split, self.fold_count, self.seed, trials.classes
        )


def _digests(trial: CameraTrial, mixed: bool, *, turned: bool = False) -> tuple[str, ...]:
    if mixed:
        return trial.digests(turned=turned)
    return (trial.digest, trial.turned) if turned else (trial.digest,)


def _alike(trials: list[CameraTrial]) -> dict[str, list[str]]:
    """Return the names of the trials that hold each set of images, whichever camera saw which."""
    found: dict[str, list[str]] = {}
    for trial in trials:
        found.setdefault(min(trial.digest, trial.turned), []).append(trial.name)
    return found


def _in_turn(verb: Any) -> bool:
    options = verb.options
    single = (options.split or "").startswith(("order:", "split"))
    return not (options.folds or options.test or single)


FOLDS_IN_TURN = Only(
    ("fold-count",),
    "folds in turn (no --folds, --test, --split order: or --split split)",
    _in_turn,
)
"""Where the test trials are given, or are the later ones, there is nothing to count."""
