"""Objects kept for testing: small folders, of which none could be kept, are refused."""

from __future__ import annotations

import pytest

from taxel.errors import BadDataset
from taxel.training.backbones.touch_images import ImageSource, split_objects


def test_two_folders_too_small_to_keep_an_object_of_are_refused() -> None:
    names = [f"{folder}/{thing}" for folder in "ab" for thing in "xyz"]
    videos = [ImageSource(name, name, lambda count: iter(())) for name in names]
    with pytest.raises(BadDataset, match="at least 5 objects in one of the folders"):
        split_objects(videos)
