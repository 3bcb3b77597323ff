"""Cameras that show the same images are warned of: two views of a touch would be one."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from taxel.evaluation.audit.audit import audit
from taxel.evaluation.audit.touch_set import TouchSet


@pytest.mark.parametrize("alike", [0, 1, 16])
def test_cameras_of_the_same_images_are_warned_of_with_in_how_many_trials(
    make_set: dict[str, Callable[..., TouchSet]], alike: int
) -> None:
    touch = make_set["camera"](trials=16)
    left = np.array(touch.views) == "left"
    rows = [np.tile(own[:, left], 2) if at < alike else own for at, own in enumerate(touch.rows)]

    found = audit(replace(touch, rows=tuple(rows)), "trials")

    warnings = [note for note in found.notes if "same images" in note]
    warning = (
        f"warning: the cameras left and right show the same images in {alike} of 16 trials; give "
        "each the files of its own"
    )
    assert warnings == ([warning] if alike else [])
