"""Objects kept for testing: small folders, of which none could be kept, are refused."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from taxel.errors import BadDataset
from taxel.training.backbones.touch_images import ImageSource, _object, split_objects


def test_two_folders_too_small_to_keep_an_object_of_are_refused() -> None:
    names = [f"{folder}/{thing}" for folder in "ab" for thing in "xyz"]
    videos = [ImageSource(name, name, lambda count: iter(())) for name in names]
    with pytest.raises(BadDataset, match="at least 5 objects in one of the folders"):
        split_objects(videos)


def test_a_recording_of_no_object_is_refused_by_what_an_import_can_add() -> None:
    """Imports have no --group: their groups are columns of the table."""
    pour: Any = SimpleNamespace(path=Path("a.mcap"), groups={"session": "1"})
    with pytest.raises(BadDataset, match="a column group:object in the table, or record again"):
        _object(pour)
