"""`train --like` of a choice that sees images needs channels that lie in a grid."""

from types import SimpleNamespace
from typing import Any

import pytest

from taxel.errors import BadInput
from taxel.evaluation.expert import _cut_as
from taxel.models.grid_features import Grid


def cut(monkeypatch: pytest.MonkeyPatch, block: str, grids: tuple[Grid, ...]) -> Any:
    """Cut as a choice of one block says, of an array with these grids."""
    prepared = SimpleNamespace(grids=grids)
    monkeypatch.setattr("taxel.evaluation.expert.prepare", lambda *_: prepared)
    base: Any = SimpleNamespace(target="kind")
    like: Any = SimpleNamespace(
        target="kind", window=SimpleNamespace(steps=1), members=[SimpleNamespace(blocks=(block,))]
    )
    return _cut_as(base, like) is prepared


@pytest.mark.parametrize("block", ["imprint", "grid/level"])
def test_a_choice_of_images_is_refused_where_no_channels_lie_in_a_grid(
    monkeypatch: pytest.MonkeyPatch, block: str
):
    with pytest.raises(BadInput, match="channels in a grid"):
        cut(monkeypatch, block, ())
    assert cut(monkeypatch, block, (Grid(3, 3, 0, 3, 1),))


def test_another_choice_needs_no_grid(monkeypatch: pytest.MonkeyPatch):
    assert cut(monkeypatch, "level", ())
