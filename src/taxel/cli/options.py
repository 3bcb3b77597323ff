"""Options that several verbs share: the recipe, and what to change in it.

Knows nothing about what is done with them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.training.recipes import Recipe

_LARGEST_SEED = 1_000_000_000
"""As for the simulators: larger ones overflow where an epoch's own seed is made from it."""


@dataclass(frozen=True, kw_only=True)
class RecipeOptions:
    """A recipe by name, and changes to it; what is not given stays as the recipe has it."""

    recipe: str = "teng"
    """A named set of window, model and training; see them with: taxel models."""
    model: str | None = None
    """Model's name; see them with: taxel models."""
    target: str | None = None
    """The label to tell, such as shape, material, sign or object, or two joined: shape+material."""
    split: str | None = None
    """How accuracy is measured: random (leaks), group:KEY or
    order:KEY:LAST[:END] (train up to LAST, test above it, up to END)."""
    steps: int | None = None
    """Rows in a window."""
    stride: int | None = None
    """Rows from one window's start to the next."""
    grid: str | None = None
    """Rows a second of the common time grid, Hz, or "own" for the sensor's own scans."""
    gate: str | None = None
    """Contact threshold in the channels' unit (V for the TENG hand), "none", or a recording of
    the array at rest, whose noise sets it."""
    layout: Literal["A", "B"] | None = None
    """B: whole scans; A: single values above the gate."""
    channels: tuple[str, ...] | None = None
    """Names of the channels to use; all unless given."""
    pad: bool | None = None
    """Pad and mask sequences that are shorter than a window."""
    tare: bool | None = None
    """Take the window's first row from all its rows."""
    wavelet: str | None = None
    """Wavelet that each channel of a window is denoised by, such as db2, or "none"."""
    segment: str | None = None
    """Values of a window that are not above this are background, in the channels' unit, or
    "none"."""
    reference: str | None = None
    """Bring each session to one level by its first touches of a known object, KEY=VALUE:COUNT such
    as object=cylinder-glass:3; those touches are neither learned from nor tested. "none" does
    not."""
    epochs: int | None = None
    """Passes over the training windows."""
    members: int | None = None
    """Networks whose probabilities are averaged."""
    seed: int = 0
    """Seed of weights, order and folds."""

    def resolve(self) -> Recipe:
        """Return the recipe with all changes made.

        Raises:
            BadInput: There is no such recipe, or a change does not fit.
        """
        from taxel.training.recipes import find_recipe
        from taxel.windows.reference import parse_reference

        self._check_counts()
        recipe = find_recipe(self.recipe)
        changes = self._window_changes()
        if (
            changes.get("layout", recipe.window.layout) == "A"
            and changes.get("gate", recipe.window.gate) is None
        ):
            raise BadInput("a gate for layout A", "none", "give one with --gate")
        if changes.get("layout", recipe.window.layout) == "A" and changes.get("wavelet"):
            raise BadInput("layout B for a wavelet", "layout A", "leave one of them out")
        window = replace(recipe.window, **changes)
        if window.reference is not None:
            parse_reference(window.reference)
        if self.steps is not None and self.stride is None:
            window = replace(window, stride=self.steps)
        train = replace(recipe.train, seed=self.seed)
        longer = recipe.train_steps
        if longer is not None:
            longer = round(longer * window.steps / recipe.window.steps)
        if self.epochs is not None:
            train = replace(train, epochs=self.epochs)
        return replace(
            recipe,
            window=window,
            train=train,
            model=self.model or recipe.model,
            target=self.target or recipe.target,
            split=self.split or recipe.split,
            members=self.members or recipe.members,
            train_stride=None if self.split == "random" else recipe.train_stride,
            train_steps=longer,
        )

    def _check_counts(self) -> None:
        """Refuse numbers that no training could use, before any recording is read."""
        for name in ("steps", "stride", "epochs", "members"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise BadInput(f"--{name} of at least 1", str(value), "give a larger number")
        if not 0 <= self.seed <= _LARGEST_SEED:
            raise BadInput(f"--seed within 0 and {_LARGEST_SEED}", str(self.seed), "choose another")

    def _window_changes(self) -> dict[str, Any]:
        given = {
            "steps": self.steps,
            "stride": self.stride,
            "layout": self.layout,
            "channels": self.channels,
            "pad": self.pad,
            "tare": self.tare,
        }
        changes: dict[str, Any] = {k: v for k, v in given.items() if v is not None}
        if self.wavelet is not None:
            changes["wavelet"] = None if self.wavelet == "none" else self.wavelet
        if self.segment is not None:
            none = self.segment == "none"
            changes["segment"] = None if none else _number("--segment", self.segment)
        if self.reference is not None:
            changes["reference"] = None if self.reference == "none" else self.reference
        if self.gate is not None:
            changes["gate"] = None if self.gate == "none" else self._gate(self.gate)
        if self.grid is not None:
            changes["grid_hz"] = None if self.grid == "own" else _number("--grid", self.grid)
            if changes["grid_hz"] is not None and changes["grid_hz"] <= 0:
                raise BadInput("--grid above 0 Hz, or own", self.grid, "for example --grid 100")
        return changes

    def _gate(self, text: str) -> float:
        """Return a gate given as a number, or measured from a recording of the array at rest.

        The recording is no part of the data set, so that nothing is measured on a test fold.
        """
        if not text.endswith(".mcap"):
            return _number("--gate", text)
        from taxel.recordings.reader import read_recording
        from taxel.windows.gate import noise_gate

        recording = read_recording(Path(text))
        samples, sensor = recording.samples, recording.manifest.sensor
        if self.channels is not None:
            try:
                samples = samples.only(sensor.indices(self.channels))
            except ValueError as error:
                raise BadInput(f"the channels of {text}", str(error), "mend --channels") from error
        try:
            return noise_gate(samples.values, samples.usable)
        except ValueError as error:
            raise BadInput(
                "a recording of the array at rest for --gate",
                f"{text}: {error}",
                "record some seconds without contact",
            ) from error


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


def _number(option: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"a number for {option}", repr(text), f"for example {option} 1.55")
    return value
