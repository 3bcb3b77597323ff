"""Named quantities of a gel image that announce incipient slip, one row a frame.

Input: frames of one gel, oldest first, RGB. Output: float32 rows. What the
dots do is the gel's movement; what the imprint does is the object's; where
they part, the object slips. Real and simulated frames are treated alike.
Knows nothing about labels, models, time in seconds or force.

Background of our choices: docs/decisions/0013.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSource
from taxel.gel.contact import ContactFinder, imprint_mask
from taxel.gel.markers import MarkerFlow, MarkerTracker, Rgb, check_rgb
from taxel.gel.motion import RegionMotion, dots_in, fit_motion, summarise_flow
from taxel.gel.scale import ROW_PX
from taxel.gel.texture import TextureFlow, TextureFollower

SLIP_FEATURES: Final[tuple[str, ...]] = (
    "change",
    "contact_share",
    "contact_change",
    "dots_seen",
    "gel_x",
    "gel_y",
    "gel_turn",
    "gel_stretch",
    "gel_residual",
    "around_x",
    "around_y",
    "shear_x",
    "shear_y",
    "shear",
    "shear_rate",
    "turn_rate",
    "residual_rate",
    "object_x",
    "object_y",
    "slip_x",
    "slip_y",
    "slip",
    "slip_rate",
    "slip_turn",
    "slip_spread",
    "slipping_share",
    "texture_share",
)
"""The columns. Lengths in px of a 320-pixel row, turns in radians, shares 0 to 1, rates a frame.

change: mean relative change of brightness against the reference; contact_change: in contact.
gel_*, around_*: dots' movement since the reference in contact and around it; shear: their
difference. object_*: the imprint's movement since the reference; slip_*: the imprint's less the
dots', slip_turn its turn, slip_spread its spread over places (px), slipping_share the share of
places that parted from the gel by more than 1 px. texture_share: of the contact, where the
imprint could be followed at all; slip_* keep their last value while it is 0.
"""

LAG_FRAMES: Final = 5
"""Frames over which rates are taken: 0.2 s at 25 frames a second. Our choice."""
_NEW_KEY_PX = 4.0
"""Movement at which the imprint's key frame is renewed: the optical flow's safe reach."""
_FEWEST_PLACES = 6
_SLIPPING_PX = 1.0
_LEAST_CONTACT = 0.01
"""Share of the image under which the whole image is taken for the contact."""
_FEWEST_DOTS = 4
"""Dots that motion is fitted on at the least: the nearest, where fewer lie in the contact."""


class SlipFeatures:
    """Turns frames into rows of `SLIP_FEATURES`, one at a time.

    Args:
        reference_frames: One or more frames before the load changes: touch-free
            or settled; their median is the reference.

    Raises:
        BadSource: There is none, or their shapes differ.
    """

    def __init__(self, reference_frames: Sequence[Rgb]) -> None:
        reference = median_frame(reference_frames)
        self._scale = reference.shape[1] / ROW_PX
        self._tracker = MarkerTracker(reference)
        self._contact = ContactFinder(reference)
        self._settled = imprint_mask(reference)
        self._texture = TextureFollower(reference.shape)
        self._texture.follow(reference)
        self._key_dots = self._tracker.track(reference)
        self._slip_before = np.zeros(3)
        self._object_before = np.zeros(2)
        self._slip_now, self._object_now = np.zeros(3), np.zeros(2)
        self._spread, self._slipping = 0.0, 0.0
        self._past: deque[NDArray[np.float64]] = deque(maxlen=LAG_FRAMES + 1)

    def push(self, rgb: Rgb) -> NDArray[np.float32]:
        """Return the next frame's row, shape (len(SLIP_FEATURES),).

        Args:
            rgb: Shape as the reference's, red first.

        Raises:
            BadSource: The frame has another shape than the reference.
        """
        change = self._contact.change(rgb)
        mask = self._contact.mask_of(change) | self._settled
        share = float(mask.mean())
        if share < _LEAST_CONTACT:
            mask = np.ones_like(mask)
        dots = self._tracker.track(rgb)
        gel = summarise_flow(dots, _inside(dots, mask))
        texture_share = self._follow(rgb, dots, mask)
        row = {"change": float(change.mean()), "contact_share": share}
        row["contact_change"] = float(change[self._contact.at_work(mask)].mean())
        row |= _gel_columns(dots, gel, self._scale)
        row |= self._slip_columns() | {"texture_share": texture_share}
        row |= self._rates(row)
        return np.array([row[name] for name in SLIP_FEATURES], np.float32)

    def _follow(self, rgb: Rgb, dots: MarkerFlow, mask: NDArray[np.bool_]) -> float:
        """Update slip since the reference; return the share of the contact with texture."""
        texture = _within(self._texture.follow(rgb), mask, self._scale)
        cells = max(1.0, float(mask.sum()) / self._texture.px_per_place)
        if len(texture.places) < _FEWEST_PLACES:
            self._renew(dots)
            return min(1.0, len(texture.places) / cells)
        since = MarkerFlow(self._key_dots.moved, dots.moved, dots.seen & self._key_dots.seen)
        gel = fit_motion(since, _inside(since, mask))
        parted = texture.steps - gel.at(texture.places)
        whole = MarkerFlow(texture.places, texture.places + parted, _all(texture))
        slip = fit_motion(whole, texture.contrast)
        moved = np.average(texture.steps, axis=0, weights=texture.contrast)
        here = np.array([*slip.translation_px / self._scale, slip.rotation_rad])
        self._slip_now = self._slip_before + here
        self._object_now = self._object_before + moved / self._scale
        far = np.linalg.norm(parted, axis=1) / self._scale
        self._spread, self._slipping = (
            slip.residual_px / self._scale,
            float(np.average(far > _SLIPPING_PX, weights=texture.contrast)),
        )
        if max(np.abs(moved).max(), np.abs(gel.translation_px).max()) > _NEW_KEY_PX * self._scale:
            self._renew(dots)
        return min(1.0, len(texture.places) / cells)

    def _renew(self, dots: MarkerFlow) -> None:
        """Count on from this frame."""
        self._texture.renew()
        self._key_dots = dots
        self._slip_before, self._object_before = self._slip_now, self._object_now

    def _slip_columns(self) -> dict[str, float]:
        x, y, turn = self._slip_now
        return {
            "object_x": float(self._object_now[0]),
            "object_y": float(self._object_now[1]),
            "slip_x": float(x),
            "slip_y": float(y),
            "slip": float(np.hypot(x, y)),
            "slip_turn": float(turn),
            "slip_spread": self._spread,
            "slipping_share": self._slipping,
        }

    def _rates(self, row: dict[str, float]) -> dict[str, float]:
        """Return changes a frame over the last frames; 0 for the first."""
        names = ("shear_x", "shear_y", "slip_x", "slip_y", "gel_turn", "gel_residual")
        self._past.append(np.array([row[name] for name in names]))
        step = (self._past[-1] - self._past[0]) / max(1, len(self._past) - 1)
        return {
            "shear_rate": float(np.hypot(step[0], step[1])),
            "slip_rate": float(np.hypot(step[2], step[3])),
            "turn_rate": float(step[4]),
            "residual_rate": float(step[5]),
        }


def median_frame(frames: Sequence[Rgb]) -> Rgb:
    """Return the median of several frames, rounded, shape as theirs.

    Raises:
        BadSource: There is none, or their shapes differ.
    """
    if not len(frames):
        raise BadSource("at least one reference frame", "none", "give the settled first frames")
    for frame in frames:
        check_rgb(frame)
    if len({frame.shape for frame in frames}) > 1:
        raise BadSource("reference frames of one shape", "several", "give them from one camera")
    if len(frames) == 1:
        return frames[0]
    return np.asarray(np.rint(np.median(np.stack(frames), axis=0)), np.uint8)


def _inside(dots: MarkerFlow, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which dots are in contact; the nearest few where hardly any is."""
    inside = dots_in(dots.moved, mask)
    if inside.sum() >= _FEWEST_DOTS or len(inside) < _FEWEST_DOTS:
        return inside
    rows, columns = np.nonzero(mask)
    far = np.linalg.norm(dots.moved - (columns.mean(), rows.mean()), axis=1)
    nearest = np.zeros_like(inside)
    nearest[np.argsort(far)[:_FEWEST_DOTS]] = True
    return nearest


def _within(texture: TextureFlow, mask: NDArray[np.bool_], scale: float) -> TextureFlow:
    """Return the places in contact whose movement is within the flow's reach."""
    held = dots_in(texture.places, mask)
    held &= np.abs(texture.steps).max(axis=1, initial=0.0) < 4 * _NEW_KEY_PX * scale
    return TextureFlow(texture.places[held], texture.steps[held], texture.contrast[held])


def _all(texture: TextureFlow) -> NDArray[np.bool_]:
    return np.ones(len(texture.places), np.bool_)


def _gel_columns(dots: MarkerFlow, gel: RegionMotion, scale: float) -> dict[str, float]:
    inside, outside = gel.inside, gel.outside
    shear = gel.shear_px / scale
    return {
        "dots_seen": float(dots.seen.mean()) if len(dots.seen) else 0.0,
        "gel_x": float(inside.translation_px[0]) / scale,
        "gel_y": float(inside.translation_px[1]) / scale,
        "gel_turn": inside.rotation_rad,
        "gel_stretch": inside.dilation,
        "gel_residual": inside.residual_px / scale,
        "around_x": float(outside.translation_px[0]) / scale,
        "around_y": float(outside.translation_px[1]) / scale,
        "shear_x": float(shear[0]),
        "shear_y": float(shear[1]),
        "shear": float(np.hypot(*shear)),
    }
