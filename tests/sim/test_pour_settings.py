"""Settings that no simulator has are refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from taxel.errors import BadInput
from taxel.sim.pour.cup_pour import CupPourConfig
from taxel.sources.simulated.data_sets import simulate_presets


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"positions": ("top",)}, "needed positions among upper, middle and lower"),
        ({"forces_n": (15.0, -1.0)}, "forces above 0 N"),
        ({"seed": -1}, "a seed from 0"),
    ],
)
def test_pours_that_do_not_exist_are_refused(setting: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        CupPourConfig(**setting)


@pytest.mark.parametrize("presets", [("honset",), "honest"])
def test_a_preset_that_does_not_exist_is_refused(tmp_path: Path, presets: tuple[str, ...]) -> None:
    """A misspelt one gave the honest set under its name."""
    with pytest.raises(BadInput, match="needed preset among"):
        simulate_presets(tmp_path, presets, 300, 0)

    assert not list(tmp_path.iterdir())
