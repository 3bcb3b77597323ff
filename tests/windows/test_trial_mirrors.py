"""A crop's mirror image, from its numbers alone, is what a mirrored video gives."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.windows.trial_crops import FAMILIES, STILLS, Scene, look_at, row_of
from taxel.windows.trial_mirrors import SIDES, mirrors

VIEWS = ("pixels", "slip", "stills")
AXES = {0: (1,), 1: (0,), 2: (0, 1)}
"""Index in `mirrors` → image axes that it turns round."""


def moving_patch(seed: int, frames: int = 12) -> list[NDArray[np.uint8]]:
    """A lopsided bright patch that wanders over a textured ground; images (120, 160, 3)."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:120, :160].astype(np.float32)
    ground = rng.normal(0, 12, (15, 20)).repeat(8, axis=0).repeat(8, axis=1)
    images = []
    for number in range(frames):
        at = np.exp(-(((x - 50 - 3 * number) / 14) ** 2 + ((y - 45 - number) / 22) ** 2))
        grey = 110 + ground + 70 * at + rng.normal(0, 1.0, x.shape)
        colours = np.stack([grey, 0.8 * grey, 0.6 * grey + 0.3 * x], axis=2)
        images.append(np.clip(np.rint(colours), 0, 255).astype(np.uint8))
    return images


def row(videos: list[list[NDArray[np.uint8]]]) -> tuple[NDArray[np.float32], dict[str, int]]:
    """One crop's numbers, shape (columns,), a video a camera; and each view's width."""
    found = row_of(look_at(VIEWS, [Scene(images, 25.0, 0.065) for images in videos]))
    return np.concatenate(list(found.values())), {name: len(v) for name, v in found.items()}


@pytest.mark.parametrize("cameras", [1, 2])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_mirrored_row_is_the_row_of_the_mirrored_video(cameras: int, which: int) -> None:
    """Grey differences and thumbs to rounding; flow, edges and slip far better than unmirrored."""
    videos = [moving_patch(seed) for seed in range(cameras)]
    turned = [[np.ascontiguousarray(np.flip(i, AXES[which])) for i in images] for images in videos]
    own, widths = row(videos)
    wanted, _ = row(turned)
    found = mirrors(widths, cameras)[which].apply(own[None])[0]

    scale = np.abs(wanted) + 0.05
    assert np.median(np.abs(found - wanted) / scale) < 1e-3
    assert (np.abs(found - wanted) / scale).mean() < 0.5 * (np.abs(own - wanted) / scale).mean()
    stills = found[-widths["stills"] :].reshape(-1, STILLS)
    assert stills[:, :48] == pytest.approx(wanted[-widths["stills"] :].reshape(-1, STILLS)[:, :48],
                                           abs=0.51)  # fmt: skip


@pytest.mark.parametrize("cameras", [1, 2])
def test_a_mirror_seen_in_the_same_mirror_is_the_crop_itself(cameras: int) -> None:
    widths = row([moving_patch(0)] * cameras)[1]
    rows = np.random.default_rng(0).normal(size=(3, sum(widths.values()))).astype(np.float32)
    for mirror in mirrors(widths, cameras):
        assert np.array_equal(mirror.apply(mirror.apply(rows)), rows)
        assert not np.array_equal(mirror.apply(rows), rows)


def test_what_a_mirror_does_not_change_stays() -> None:
    """The slip signal and the touch encoder's numbers are left as they are."""
    widths = {"slip": 7, "touch": 4}
    rows = np.arange(11, dtype=np.float32)[None]
    for mirror in mirrors(widths, 1):
        assert np.array_equal(mirror.apply(rows), rows)


def test_flow_to_the_left_is_flow_to_the_right_in_a_mirror() -> None:
    """The mean of flow in x has the other sign, that of grey differences stays."""
    own, widths = row([moving_patch(0)])
    mirrored = mirrors(widths, 1)[SIDES.index("left for right")].apply(own[None])[0]
    assert FAMILIES["pixels"].columns == widths["pixels"] // 12
    assert mirrored[5] == -own[5] != 0
    assert mirrored[:5] == pytest.approx(own[:5])
