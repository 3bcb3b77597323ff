"""A run whose model is larger than a bundle may be: train says so, and names no command."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from taxel.cli.training.train_recipe import RecipeTraining, _print
from taxel.models.cnn2d import Cnn2d
from taxel.training.loop import new_network


@pytest.mark.parametrize(("most", "large"), [(1000, True), (10**6, False)])
def test_train_does_not_name_a_command_that_would_be_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], most: int, large: bool
):
    monkeypatch.setattr("taxel.bundles.writer.LARGEST_BYTES", most)
    contract = SimpleNamespace(parameters=9, classes=("a", "b"), unknown=None)
    run = SimpleNamespace(networks=(new_network(lambda: Cnn2d(12, 12, 3), 0),), contract=contract)
    training = SimpleNamespace(
        output=Path("runs/y"), given=SimpleNamespace(table=None),
        recipe=SimpleNamespace(model="course-forest", target="object"),
    )  # fmt: skip

    _print(cast(RecipeTraining, training), cast(Any, run), None, replaced=False)

    printed = " ".join(capsys.readouterr().out.split())
    assert ("warning: it can be neither bundled nor reported: needed a model" in printed) == large
    assert ("next: taxel bundle" in printed) != large
