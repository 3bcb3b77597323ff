"""The live path of a camera trial: frames in, a verdict that builds up, a last one at its end.

Each half crop a further crop is looked at, and the verdict is that of all crops so far. When the
trial is over, the verdict is the one that evaluation gives: of the first, middle and last crop of
it, or of its part in which something moves, as the bundle says.
Adds no maths of its own. Knows nothing about screens or training frameworks.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.trials import TrialBundle
from taxel.decisions.trial_verdict import Verdict, VerdictConfig, join_crops, no_verdict
from taxel.errors import BadSource
from taxel.frame_codec import decode_frame
from taxel.live.camera_health import CameraHealth
from taxel.plain_text import number_of
from taxel.signals import CameraInfo, Frame, Mark
from taxel.windows.pairs import FrameSet, within
from taxel.windows.trial_crops import PLACES, Scene, look_at, row_of
from taxel.windows.trial_stretch import Changes, part_of

MOST_FRAMES = 9000
"""Moments of a trial that are kept, as JPEG: five minutes at 30 a second, some 200 MB a camera. The
verdict on a longer trial is the last one given while it ran. Source: our choice, decision 41."""


@dataclass(frozen=True, slots=True)
class TrialAnswer:
    """A verdict at one moment."""

    verdict: Verdict
    time_s: float
    """When the newest frame was taken, fitted clock, seconds."""
    frames: int
    """Moments of the trial so far."""
    last: bool
    """True where the trial is over."""
    looked: bool
    """True where a crop was looked at for this answer."""
    latency_s: float
    """From the frames in hand to the verdict, decoding included, seconds."""


class TrialWatch:
    """Turn sets of frames into verdicts on the trial that they belong to.

    Args:
        bundle: What is recognised.
        cameras: The source's.
        least_confidence: Below this probability the verdict is UNKNOWN, 0…1.
        before_look: Called before each look at a crop, which may take a second, and before a
            moment's images are compared, which a trial's end may do for all of them.

    Raises:
        BadBundle: The bundle was not made for such cameras.
    """

    def __init__(
        self,
        bundle: TrialBundle,
        cameras: tuple[CameraInfo, ...],
        least_confidence: float = 0.5,
        before_look: Callable[[], None] = lambda: None,
    ) -> None:
        contract = bundle.contract
        contract.check(
            [camera.name for camera in cameras],
            [(camera.width, camera.height) for camera in cameras],
            [camera.rate_hz for camera in cameras],
        )
        self.bundle = bundle
        self._cameras = cameras
        self._config = verdict_config(bundle, least_confidence)
        self._health = CameraHealth(cameras)
        self._before_look = before_look
        self.reset()

    def reset(self) -> None:
        """Forget the trial: the next frames begin another."""
        self._sets: list[FrameSet] = []
        self._changes = Changes(self.bundle.contract.layout.step)
        self._count = 0
        self._so_far = VerdictSoFar(self.bundle, self._config)
        self._verdict = no_verdict(self.bundle.contract.classes, "no frame yet")
        self._bad = ""
        self._gone: TrialAnswer | None = None

    def see(self, frame: Frame) -> TrialAnswer | None:
        """Look after a camera's health by every frame of it.

        Frames of a camera whose partner is gone make no set, so that `push` hears nothing of it:
        this gives the verdict UNKNOWN then, None otherwise.
        """
        self._health.see(frame)
        return self.at(frame.arrival_s)

    def at(self, now_s: float) -> TrialAnswer | None:
        """Return the verdict UNKNOWN once a camera that the trial was seen by is gone, else None.

        Args:
            now_s: This moment, on the clock of `Frame.arrival_s`, seconds.
        """
        self._gone = None
        if self._count and (reason := self._health.gone(now_s)):
            verdict = no_verdict(self.bundle.contract.classes, reason)
            time_s = self._sets[-1].time_s
            self._gone = TrialAnswer(verdict, time_s, self._count, False, False, 0.0)
        return self._gone

    def push(self, found: FrameSet, *, look: bool = True) -> TrialAnswer:
        """Take in the newest frame of each camera; return the verdict so far.

        Args:
            found: The frames.
            look: False lets a crop that ends here go, where too many frames wait.
        """
        started = perf_counter()
        contract = self.bundle.contract
        self._count += 1
        if self._count <= MOST_FRAMES:
            self._sets.append(found)
            self._compare(found)
        else:
            left = max(0, len(self._sets) - contract.layout.span + 1)
            self._sets = [*self._sets[left:], found]
        past = self._count - contract.layout.span
        looked = look and past >= 0 and past % contract.layout.every == 0
        if past < 0:
            self._verdict = self._too_few()
        elif looked:
            self._look()
        doubt = self._bad or self._health.doubt(max(frame.arrival_s for frame in found.frames))
        verdict = no_verdict(contract.classes, doubt) if doubt else self._verdict
        return TrialAnswer(
            verdict, found.time_s, self._count, False, looked, perf_counter() - started
        )

    def finish(self, mark: Mark | None = None) -> TrialAnswer | None:
        """Hear that the trial is over; return the verdict on the whole of it, None without any.

        It is UNKNOWN where a camera was gone at the end: what the others saw alone is no part of
        it. The next frames begin another trial.

        Args:
            mark: The trial's stretch: what was seen outside of it is left out. None takes all.
        """
        started = perf_counter()
        if mark is not None:
            self._cut(mark)
        if not self._count:
            self.reset()
            return None
        gone = None if self._gone is None else self._gone.verdict
        verdict = self._bad_verdict() or gone or self._whole()
        answer = TrialAnswer(
            verdict, self._sets[-1].time_s, self._count, True, True, perf_counter() - started
        )
        self.reset()
        return answer

    def _cut(self, mark: Mark) -> None:
        """Forget what was seen outside of a stretch; a trial too long to be kept stays as it is."""
        inside = [within(own.time_s, mark.start_s, mark.end_s) for own in self._sets]
        if self._count > MOST_FRAMES or all(inside):
            return
        self._changes.values = list(compress(self._changes.values, inside))
        self._sets = list(compress(self._sets, inside))
        self._count = len(self._sets)
        if self._count < self.bundle.contract.layout.span:
            self._verdict = self._too_few()
        elif not inside[0]:  # changes are measured from the trial's own first moment
            self._changes = Changes(self.bundle.contract.layout.step)
            for own in self._sets:
                self._compare(own)

    def _compare(self, found: FrameSet) -> None:
        """Hear how much a moment's images differ from those before, where crops depend on it."""
        if self._bad or not self.bundle.contract.layout.moving:
            return
        self._before_look()
        try:
            self._changes.push(self._images([found])[0])
        except BadSource as error:
            self._bad = error.got

    def _too_few(self) -> Verdict:
        contract = self.bundle.contract
        so_far = f"{self._count} of the {number_of(contract.layout.span, 'frame')} of a crop"
        return no_verdict(contract.classes, so_far)

    def _bad_verdict(self) -> Verdict | None:
        return no_verdict(self.bundle.contract.classes, self._bad) if self._bad else None

    def _look(self) -> None:
        """Look at the crop that ends now, beside those before."""
        try:
            own, novelty = self._crop(self._sets[-self.bundle.contract.layout.span :])
        except BadSource as error:
            self._bad = error.got
            return
        self._verdict = self._so_far.add(own, novelty)

    def _whole(self) -> Verdict:
        contract = self.bundle.contract
        if self._count < contract.layout.span or self._count > MOST_FRAMES:
            return self._verdict
        try:
            part = part_of(contract.layout, self._count, lambda: self._changes.values)
            starts = contract.layout.starts(part)
            span = contract.layout.span
            return self._joined([self._crop(self._sets[at : at + span]) for at in starts])
        except BadSource as error:
            return no_verdict(contract.classes, error.got)

    def _joined(self, answers: Sequence[tuple[NDArray[np.float64], float]]) -> Verdict:
        probabilities = np.stack([own for own, _ in answers])
        novelty = np.array([score for _, score in answers])
        return join_crops(probabilities, novelty, self.bundle.contract.classes, self._config)

    def _crop(self, sets: Sequence[FrameSet]) -> tuple[NDArray[np.float64], float]:
        self._before_look()
        moments = self._images(sets[:: self.bundle.contract.layout.step])
        probabilities, novelty = predict_crop(self.bundle, list(zip(*moments, strict=True)))
        return probabilities, novelty

    def _images(self, sets: Sequence[FrameSet]) -> list[list[NDArray[np.uint8]]]:
        """Return the images of some moments, one a camera.

        Raises:
            BadSource: An image is damaged, or not of the camera's size.
        """
        return [
            [
                decode_frame(frame.jpeg, own)
                for frame, own in zip(found.frames, self._cameras, strict=True)
            ]
            for found in sets
        ]


class VerdictSoFar:
    """The verdict of all crops of a trial that were looked at while it runs, which count alike.

    Sums are kept alone, since without marks a trial lasts as long as its cameras.

    Args:
        bundle: What is recognised.
        config: When a verdict may be given.
    """

    def __init__(self, bundle: TrialBundle, config: VerdictConfig) -> None:
        self._classes, self._config = bundle.contract.classes, config
        self._total = np.zeros(len(self._classes))
        self._novelty, self._crops = 0.0, 0

    def add(self, probabilities: NDArray[np.float64], novelty: float) -> Verdict:
        """Take in one crop more; return the verdict.

        Args:
            probabilities: The crop's, shape (classes,).
            novelty: Its novelty score.
        """
        self._total, self._novelty = self._total + probabilities, self._novelty + novelty
        self._crops += 1
        mean, score = self._total / self._crops, np.array([self._novelty / self._crops])
        verdict = join_crops(mean[None], score, self._classes, self._config)
        return replace(verdict, crops=self._crops)


def verdict_config(bundle: TrialBundle, least_confidence: float = 0.5) -> VerdictConfig:
    """Return when a bundle's verdict may be given."""
    return VerdictConfig(
        sharpness=bundle.contract.sharpness,
        places=tuple(bundle.contract.weights[name] for name in PLACES if bundle.contract.weights),
        threshold=bundle.contract.threshold,
        least_confidence=least_confidence,
    )


def predict_crop(
    bundle: TrialBundle, images: Sequence[Sequence[NDArray[np.uint8]]]
) -> tuple[NDArray[np.float64], float]:
    """Return one crop's probabilities, shape (classes,), and its novelty.

    Args:
        bundle: What is recognised.
        images: A camera each, the crop's images, red first.
    """
    contract = bundle.contract
    rate_hz = contract.rate_hz / contract.layout.step
    scenes = [Scene(own, rate_hz, contract.mm_per_px, bundle.network) for own in images]
    row = row_of(look_at(contract.views, scenes))
    rows = np.concatenate([row[name] for name in contract.views])[None]
    probabilities, novelty = bundle.predict(rows)
    return probabilities[0], float(novelty[0])
