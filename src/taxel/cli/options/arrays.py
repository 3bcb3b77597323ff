"""Options of recordings of an array that several verbs share: the recipe, and changes to it.

Knows nothing about what is done with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.cli.options.pairs import Pairs, parse_pairs
from taxel.cli.options.rules import Only
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.table_split import GivenSplit
    from taxel.training.recipes import Recipe

_LARGEST_SEED = 1_000_000_000
"""As for the simulators: larger ones overflow where an epoch's own seed is made from it."""


@dataclass(frozen=True, kw_only=True)
class RecipeOptions:
    """A recipe by name, and changes to it; what is not given stays as the recipe has it."""

    recipe: str | None = None
    """Name of a set of settings (window, model, training), such as teng or array; unless given,
    teng for the TENG hand and array for other arrays. train searches for the settings instead
    where neither recipe, model, window nor epochs are given."""
    target: str | None = None
    """The label to predict, such as shape, material, sign or object, or two joined:
    shape+material. Unless given: the recipe's, or the only label that the recordings have."""
    window: Pairs = ()
    """Changes to the recipe's window, such as steps=50 stride=25 grid=own gate=none; what is not
    named stays as in the recipe. steps: rows in a window. stride: rows from one window to the next.
    grid: rows per second, Hz, or own (each scan is a row). gate: contact threshold in the channels'
    unit, or a recording at rest (.mcap) to measure it from, or none. layout: A (values above the
    gate) or B (whole scans). channels: names, with commas between them. pad: yes pads trials that
    are shorter than a window. tare: yes subtracts a window's first row from all of its rows.
    wavelet: wavelet for denoising, such as db2, or none. segment: values up to this, in the
    channels' unit, count as background, or none. fill: gaps are interpolated in up to this share of
    a window, 0…1. reference: KEY=VALUE:COUNT, the first COUNT touches of a known object, which set
    each channel's gain in a session, or none. level: KEY:COUNT, such as session:10, each touch is
    scaled by the level of its session's earlier touches, beside which the usual level counts as
    COUNT touches; or none. follow: seconds over which each channel's gate follows its rest and
    noise, or none. subtract: an untouched channel that is subtracted from all others, or none."""
    epochs: int | None = None
    """Passes over the training windows, 1 or more; as in the recipe unless given."""
    seed: int = 0
    """Seed of weights, order and folds, 0 to 1000000000."""

    def checked_seed(self) -> int:
        """Return the seed.

        Raises:
            BadInput: It is none that every generator takes.
        """
        if not 0 <= self.seed <= _LARGEST_SEED:
            raise BadInput(f"--seed within 0 and {_LARGEST_SEED}", str(self.seed), "choose another")
        return self.seed

    def _target(self, usual: str, data: Path | None) -> str:
        if self.target is not None or data is None:
            return self.target or usual
        return only_label(data, usual)

    @property
    def unnamed(self) -> bool:
        """Return whether nothing of a recipe is named."""
        return not self.named

    @property
    def named(self) -> str:
        """Return the first option that names something of a recipe, as typed; empty if none."""
        if self.recipe is not None:
            return f"--recipe {self.recipe}"
        if self.window:
            return "--window"
        return "" if self.epochs is None else f"--epochs {self.epochs}"

    def resolve(
        self,
        *,
        default: str = "teng",
        model: str | None = None,
        split: str | None = None,
        members: int | None = None,
        data: Path | None = None,
    ) -> Recipe:
        """Return the recipe with all changes made.

        Args:
            default: Recipe where none is named.
            model: Another model.
            split: Another split.
            members: Another number of networks.
            data: Recordings whose only label is predicted where none is named and they lack the
                recipe's; where their own rates differ, they are put on one grid unless one is
                named.

        Raises:
            BadInput: There is no such recipe, or a change does not fit.
            BadRecording: A recording is damaged.
        """
        from taxel.cli.options.window_words import changed_window
        from taxel.training.recipes import find_recipe
        from taxel.windows.rates import with_common_grid

        for name, value in (("epochs", self.epochs), ("members", members)):
            if value is not None and value < 1:
                raise BadInput(f"--{name} of at least 1", str(value), "give a larger number")
        self.checked_seed()
        recipe = find_recipe(self.recipe or default)
        changes = parse_pairs(self.window, "--window")
        window = changed_window(recipe.window, changes)
        if data is not None and "grid" not in changes:
            window = with_common_grid(window, data)
        train = replace(recipe.train, seed=self.seed)
        if self.epochs is not None:
            train = replace(train, epochs=self.epochs)
        longer = recipe.train_steps
        if longer is not None:
            longer = round(longer * window.steps / recipe.window.steps)
        return replace(
            recipe,
            window=window,
            train=train,
            model=model or recipe.model,
            target=self._target(recipe.target, data),
            split=split or recipe.split,
            members=members or recipe.members,
            train_stride=None if split == "random" else recipe.train_stride,
            train_steps=longer,
            own_gate="gate" in changes,
        )


def only_label(data: Path, usual: str | None = None) -> str:
    """Return the label that recordings have, where they have one only.

    Args:
        data: A folder of recordings, or one.
        usual: The label that is meant where the recordings have it, whatever others they have.

    Raises:
        BadInput: They have none, or several to choose from.
    """
    from taxel.training.choose.base import ROWS
    from taxel.windows.dataset import load_dataset

    trials = load_dataset(data, ROWS).trials
    known = sorted({name for trial in trials for name in trial.labels})
    if usual in known:
        return usual
    if len(known) == 1:
        return known[0]
    raise BadInput(
        "--target LABEL", "none given",
        f"name one of {', '.join(known)}" if known else "label the recordings: taxel label",
    )  # fmt: skip


def usual_recipe(data: Path) -> str:
    """Return the recipe for recordings of which none is named: no gate but for the TENG hand."""
    from taxel.recordings.reader import list_recordings, read_recording
    from taxel.sim.teng.constants import SENSORS

    sensor = read_recording(list_recordings(data)[0]).manifest.sensor
    return "teng" if sensor.channels == SENSORS else "array"


def _in_folds(verb: Any) -> bool:
    from taxel.training.recipes import find_recipe

    if getattr(verb, "folds", None) is not None or getattr(verb, "test", None) is not None:
        return False
    if verb.split is None and verb.recipe.unnamed:
        return True
    split = verb.split or find_recipe(verb.recipe.recipe or "teng").split
    return split is None or not split.startswith("order:")


FOLD_COUNT = Only(("fold-count",), "a split in folds (not order:, --folds or --test)", _in_folds)
"""A split by order has one test part, however many folds are asked for; a table its own folds."""
OWN_FOLD_COUNT = Only(("fold-count",), "a split in folds (not order:)", _in_folds)
"""The same of verbs that take neither tables of folds nor another folder to test on."""


def split_given(split: str | None, folds: Path | None, test: Path | None) -> GivenSplit:
    """Return a split that came from elsewhere, if there is one.

    Args:
        split: One of taxel's own, if it was named.
        folds: A table of folds.
        test: A folder to test on.

    Raises:
        BadInput: More than one is given.
    """
    from taxel.evaluation.table_split import GivenSplit

    named = {"--split": split, "--folds": folds, "--test": test}
    given = [name for name, value in named.items() if value is not None]
    if len(given) > 1:
        raise BadInput("one of --split, --folds and --test", " and ".join(given), "give one")
    return GivenSplit(table=folds, test=test)


def check_share(option: str, share: float) -> None:
    """Refuse a share that is none, or all.

    Raises:
        BadInput: It is not between 0 and 1.
    """
    if not 0 < share < 1:
        raise BadInput(f"{option} between 0 and 1", f"{share:g}", "such as 0.05")


def check_run_folder(folder: Path) -> None:
    """Refuse a place for a run that holds something else.

    Raises:
        BadInput: It exists and is no run.
    """
    if folder.exists() and not (folder / "run.json").exists():
        raise BadInput(
            "a folder that does not exist yet, or an older run, for --output",
            f"{folder}, which holds something else",
            "choose another folder",
        )
