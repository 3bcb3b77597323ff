"""The touch encoder's member is weighed by inner folds, as the other kinds are."""

from __future__ import annotations

import numpy as np

from taxel.training.camera_trials.blend import TrialBlend, fit_blend
from taxel.training.camera_trials.learning import Extras, Learning
from taxel.training.camera_trials.members import MEMBERS

WIDTHS = {"picture": 2, "touch": 2}


def _blend(picture: float, touch: float) -> TrialBlend:
    """Return a blend on columns that lie so many deviations apart by class."""
    rng = np.random.default_rng(0)
    y = np.arange(80) % 2
    apart = np.repeat([picture, touch], 2) * y[:, None]
    learning = Learning(
        (apart + rng.normal(size=(80, 4))).astype(np.float32), np.arange(80), y,
        np.repeat(list("abcdefgh"), 10), 2, Extras(),
    )  # fmt: skip
    members = [member for member in MEMBERS if set(member.views) <= set(WIDTHS)]
    return fit_blend(learning, 1, WIDTHS, 0, [m for m in members if "trees" not in m.name])


def _weights(blend: TrialBlend) -> dict[str, float]:
    return dict(zip((member.kind for member in blend.members), blend.weights, strict=True))


def test_the_touch_encoder_counts_where_it_is_ahead_on_inner_folds() -> None:
    assert _weights(_blend(picture=0.0, touch=4.0))["touch"] > 0.5


def test_the_touch_encoder_is_left_out_where_it_says_nothing() -> None:
    assert set(_weights(_blend(picture=4.0, touch=0.0))) == {"picture"}
