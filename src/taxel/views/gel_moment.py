"""One moment of a tactile camera, in figures: contact, imprint, and where the dots went.

Dots are followed through every frame up to the moment, against the settled first frames;
contact and depth are measured against the gel as it would look untouched. Knows nothing about
sources, files or drawing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput
from taxel.frame_codec import decode_jpeg
from taxel.gel.bare import bare_gel
from taxel.gel.contact import contact_mask, contact_shape
from taxel.gel.depth import DepthModel
from taxel.gel.integration import depth_from_gradients, normals_of
from taxel.gel.markers import MarkerFlow, MarkerTracker, Rgb
from taxel.gel.motion import dots_in, summarise_flow
from taxel.gel.scale import ROW_PX, USUAL_MM_PER_PX, mm_per_row_px
from taxel.gel.slip_features import median_frame
from taxel.gel.slip_signal import GelSlip, Slip
from taxel.gel.touch_poses import TouchFollower
from taxel.labels.change import ChangeConfig
from taxel.live.slip_watch import taken_of
from taxel.plain_text import number_of
from taxel.signals import CameraInfo, Frame
from taxel.windows.pairs import FrameSet

_DEEPEST_PERCENTILE = 99.8
"""Of the depth map, which counts as its greatest depth: single pixels may be noise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GelTouch:
    """What one image says against the gel untouched, and the dots against a reference."""

    rgb: Rgb
    """Shape (height, width, 3), red first."""
    mask: NDArray[np.bool_]
    """Shape (height, width): in contact."""
    depth_mm: NDArray[np.float32]
    """Shape (height, width): into the gel, mm."""
    normals: NDArray[np.float32]
    """Shape (height, width, 3): x, y, z."""
    flow: MarkerFlow
    """Where the dots were and are."""
    mm_per_px: float
    """Size of a pixel on the gel, mm."""
    calibrated: bool = False
    """False where depth rests on another gel's presses: its shape holds, its scale is rough, up
    to 3 times the truth on simulated pours, whose gels are darker than the calibration's."""

    slip: Slip | None = None
    """How far the object has slipped over the gel; None where it was not followed."""

    @property
    def deepest_mm(self) -> float:
        """Depth of the imprint, but for single pixels, mm."""
        return float(np.percentile(self.depth_mm, _DEEPEST_PERCENTILE))

    def figures(self) -> dict[str, float | int | bool | None]:
        """Return the figures that are shown; None where it cannot be measured.

        Lengths mm (depth: see `calibrated`), areas mm², turns degrees clockwise in the image.
        `moved` and `turned`: the dots in contact; `shear`: how much further those moved than
        the dots around.
        """
        shape = contact_shape(self.mask)
        moved = summarise_flow(self.flow, dots_in(self.flow.reference, self.mask))
        known = bool(shape.area_px and moved.inside.dots)
        return {
            "contact_mm2": shape.area_px * self.mm_per_px**2,
            "deepest_mm": self.deepest_mm if shape.area_px else 0.0,
            "depth_calibrated": self.calibrated,
            "moved_mm": self._mm(moved.inside.translation_px) if known else None,
            "turned_deg": float(np.rad2deg(moved.inside.rotation_rad)) if known else None,
            "shear_mm": self._mm(moved.shear_px) if known and moved.outside.dots else None,
            "dots": len(self.flow.seen),
            "dots_seen": int(self.flow.seen.sum()),
            **({} if self.slip is None else self.slip.as_dict()),
        }

    def words(self) -> str:
        """Return the figures as one line."""
        found = self.figures()
        dots = f"{found['dots_seen']} of {found['dots']} dots seen" if found["dots"] else "no dots"
        if not found["contact_mm2"]:
            return f"no contact, {dots}"
        rough = "" if self.calibrated else " (uncalibrated)"
        parts = [
            f"contact {found['contact_mm2']:.0f} mm²",
            f"deepest {found['deepest_mm']:.2f} mm{rough}",
        ]
        if found["moved_mm"] is not None:
            turned_deg = round(found["turned_deg"] or 0.0, 1) + 0.0  # no minus zero
            parts.append(f"dots in it moved {found['moved_mm']:.2f} mm, turned {turned_deg:+.1f}°")
        if found["shear_mm"] is not None:
            parts.append(f"{found['shear_mm']:.2f} mm further than those around")
        if self.slip is not None and self.slip.seen:
            parts.append(self.slip.words)
        return ", ".join([*parts, dots])

    def _mm(self, step_px: NDArray[np.float32]) -> float:
        return float(np.hypot(*step_px)) * self.mm_per_px


def touch_of(
    rgb: Rgb,
    bare: Rgb,
    flow: MarkerFlow,
    mm_per_px: float | None = None,
    model: DepthModel | None = None,
) -> GelTouch:
    """Return what an image says.

    Args:
        rgb: Shape (height, width, 3), red first.
        bare: The same gel untouched (or settled: then the change since is shown), same shape.
        flow: Where the dots went.
        mm_per_px: Size of a pixel on the gel, mm; None takes a GelSight Mini's.
        model: From colour to slope, of this gel; None takes the one that is shipped, fitted on
            another gel.

    Raises:
        BadSource: Shapes differ, or are none of colour images.
    """
    size_mm = mm_per_px or USUAL_MM_PER_PX * ROW_PX / rgb.shape[1]
    mask = contact_mask(rgb, bare)
    gx, gy = (model or DepthModel.shipped()).gradients(rgb, bare)
    return GelTouch(
        rgb=rgb,
        mask=mask,
        depth_mm=depth_from_gradients(gx, gy, size_mm),
        normals=normals_of(gx, gy),
        flow=flow,
        mm_per_px=size_mm,
        calibrated=model is not None,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """When to look: by time or by frame; the last frame within `until_s` otherwise."""

    at_s: float | None = None
    """Seconds after the first frames: the first frames at or after this are taken."""
    frame: int | None = None
    """Number of a set of frames, one of each camera, from 0."""
    until_s: float = float("inf")
    """Where neither is said: seconds after the first frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Looked:
    """All cameras at one moment."""

    frame: int
    """Number of the set of frames, from 0."""
    time_s: float
    """Seconds after the first frames."""
    touches: tuple[GelTouch, ...]
    """One a camera."""


def look(sets: Iterable[FrameSet], cameras: Sequence[CameraInfo], moment: Moment) -> Looked:
    """Return what all cameras show at a moment, reading no further than needed.

    Memory is that of the settled frames, whatever the length.

    Args:
        sets: Frames of all cameras, oldest first, from the first one on.
        cameras: What they are.
        moment: When to look.

    Raises:
        BadInput: The video ends before the moment, or before the settled stretch does.
        BadSource: An image cannot be decoded, or changes its size.
    """
    settled = ChangeConfig().settled(cameras[0].rate_hz)
    rest = iter(sets)
    early = list(islice(rest, settled.stop))
    if len(early) < settled.stop:
        raise BadInput(
            f"at least {number_of(settled.stop, 'frame')} of each camera", f"{len(early)}",
            "record for longer: the first ones are what dots are compared with",
        )  # fmt: skip
    followers = [
        _Follower([found.frames[number].jpeg for found in early[settled]], camera)
        for number, camera in enumerate(cameras)
    ]
    index, time_s = _follow(chain(early, rest), followers, moment)
    touches = tuple(
        replace(
            touch_of(follower.rgb, bare_gel(follower.rgb), follower.flow, camera.mm_per_px),
            slip=follower.slip.slip,
        )
        for follower, camera in zip(followers, cameras, strict=True)
    )
    return Looked(frame=index, time_s=time_s, touches=touches)


def _follow(
    sets: Iterator[FrameSet], followers: Sequence[_Follower], moment: Moment
) -> tuple[int, float]:
    """Push frames up to the moment; return its number and time after the first, seconds."""
    first_s, index, time_s = 0.0, 0, 0.0
    asked = moment.at_s is not None or moment.frame is not None
    for number, found in enumerate(sets):
        first_s = found.time_s if number == 0 else first_s
        now_s = found.time_s - first_s
        if not asked and number and now_s > moment.until_s:
            return index, time_s
        index, time_s = number, now_s
        for follower, frame in zip(followers, found.frames, strict=True):
            follower.push(frame)
        if moment.at_s is not None and time_s >= moment.at_s - 1e-3:
            return index, time_s
        if moment.frame is not None and index >= moment.frame:
            return index, time_s
    if not asked:
        return index, time_s
    wanted = f"frame {moment.frame}" if moment.at_s is None else f"{moment.at_s:g} s"
    raise BadInput(f"a moment from 0 to {time_s:.3f} s, or a frame from 0 to {index}", wanted,
                   "choose one within the video")  # fmt: skip


class _Follower:
    """Follows one camera's dots and slip; equal images, one after another, are looked at once."""

    def __init__(self, settled: Sequence[bytes], camera: CameraInfo) -> None:
        self._camera = camera
        images = [decode_jpeg(jpeg, camera) for jpeg in dict.fromkeys(settled)]
        reference = median_frame(images)
        self._tracker = MarkerTracker(reference)
        self._touch = TouchFollower(images)
        size_mm = mm_per_row_px(camera.width, camera.mm_per_px)
        self._to_mm = np.array([size_mm, size_mm, 1.0])
        self._jpeg = b""
        self.slip = GelSlip()
        self.rgb: Rgb = reference
        self.flow = self._tracker.track(reference)

    def push(self, frame: Frame) -> None:
        if frame.jpeg == self._jpeg:
            return
        self._jpeg, self.rgb = frame.jpeg, decode_jpeg(frame.jpeg, self._camera)
        self.flow = self._tracker.track(self.rgb)
        pose = self._touch.follow(self.rgb)
        self.slip.push(
            pose.object * self._to_mm, pose.gel * self._to_mm, pose.spread * self._to_mm,
            taken_of(frame), pose.seen,
        )  # fmt: skip
