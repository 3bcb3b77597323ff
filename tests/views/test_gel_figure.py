"""A gel figure is a picture, whatever the gel shows."""

import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.gel.markers import MarkerTracker, Rgb
from taxel.views.figures.gel import Kind, gels_figure
from taxel.views.gel_moment import touch_of


def gel_figure(
    rgb: Rgb, reference: Rgb, title: str, mm_per_px: float | None = None, kind: Kind = "png"
) -> bytes:
    flow = MarkerTracker(reference).track(rgb)
    return gels_figure({"left": touch_of(rgb, reference, flow, mm_per_px)}, title, kind)


@pytest.mark.parametrize("level", [0, 120])
def test_a_gel_without_dots_or_contact_is_drawn(level):
    image = np.full((120, 160, 3), level, np.uint8)

    assert gel_figure(image, image, "an even gel").startswith(b"\x89PNG")


def test_dots_that_moved_are_drawn_as_vectors():
    y, x = np.mgrid[:240, :320]
    frames = []
    for shift in (0.0, 4.0):
        far = np.hypot((x - shift) % 40 - 20, y % 40 - 20)
        grey = np.where(far < 6, 45, 110)
        frames.append(np.repeat(grey[..., None], 3, axis=2).astype(np.uint8))

    drawn = gel_figure(frames[1], frames[0], "dots", mm_per_px=0.06, kind="svg")

    assert b"<svg" in drawn


def test_two_sizes_are_refused():
    with pytest.raises(BadSource):
        gel_figure(np.zeros((24, 32, 3), np.uint8), np.zeros((24, 30, 3), np.uint8), "no")
