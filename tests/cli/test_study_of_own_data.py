"""A study of the user's own array takes the recipe that every other verb takes for it."""

from pathlib import Path

import pytest
from make_pads import make_pads

from taxel.cli.evaluation.reproduce.unknown_objects import UnknownObjects
from taxel.cli.options.arrays import RecipeOptions
from taxel.cli.options.hand_sets import comparison_config
from taxel.errors import BadDataset
from taxel.evaluation.fold_jobs import Source, open_source
from taxel.evaluation.table_split import OWN_SPLIT
from taxel.evaluation.teng.model_comparison import load_windows
from taxel.training.recipes import find_recipe
from taxel.windows import dataset as windows
from taxel.windows.config import WindowConfig


class ReadError(Exception):
    """What ends a study in these tests once its recordings would be read."""


@pytest.fixture
def pads(tmp_path: Path) -> Path:
    """Newtons, with the label level alone."""
    return make_pads(tmp_path / "pads")


def test_models_are_compared_on_windows_without_the_hand_s_gate(pads: Path) -> None:
    config = comparison_config(pads, RecipeOptions(), 3)
    assert config.window == find_recipe("array").window
    assert config.targets == ("level",)


def test_simulated_grasps_keep_the_hand_s_window() -> None:
    config = comparison_config(None, RecipeOptions(), 5)
    assert config.window == find_recipe("teng").window
    assert config.targets == ("shape", "material")


def test_unknown_touch_is_sought_on_windows_without_the_hand_s_gate(
    pads: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[WindowConfig, str]] = []
    real = windows.load_dataset

    def read(path: Path, config: WindowConfig, *, target: str | None = None) -> windows.Dataset:
        if target is None:  # to see which labels there are
            return real(path, config)
        seen.append((config, target))
        raise ReadError

    monkeypatch.setattr(windows, "load_dataset", read)
    with pytest.raises(ReadError):
        UnknownObjects(data=pads).run()
    assert seen == [(find_recipe("array").window, "level")]


def test_a_gate_in_volts_for_newtons_is_refused_there_too(pads: Path) -> None:
    with pytest.raises(BadDataset, match="channels in V for a gate"):
        UnknownObjects(data=pads, recipe=RecipeOptions(recipe="teng", target="level")).run()


def test_a_gate_that_the_user_gives_is_in_the_channels_own_unit(pads: Path) -> None:
    """Also where it is as large as the TENG hand's, in volts."""
    options = RecipeOptions(window=(("gate=1.55", "grid=own"),))
    recipe = options.resolve(default="array", data=pads)
    assert len(open_source(Source(path=pads, recipe=recipe, folds=2, given=OWN_SPLIT)).dataset)
    assert len(load_windows(pads, comparison_config(pads, options, 2), "level"))
