"""The monitors that come with taxel: what they cannot follow is UNKNOWN, never STABLE."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from taxel.bundles.grasp import GraspBundle, read_grasp_bundle
from taxel.bundles.shipped import CUP_POUR, DEFAULT_WARNING, shipped_bundle
from taxel.decisions.reasons import kind_of
from taxel.decisions.stability import Stability
from taxel.errors import BadBundle
from taxel.frame_codec import decode_jpeg, encode_jpeg
from taxel.live.grasp_monitor import GraspAnswer, GraspMonitor
from taxel.signals import CameraInfo, Frame
from taxel.windows.camera_recordings import frame_sets, read_camera_recordings
from taxel.windows.pairs import FrameSet

GOOD = 50
"""Sets of frames before a fault: the settled grasp is over after 24."""
BACK = 74
"""Sets of frames before the earlier image is back, where it comes back."""
Fault = Callable[[Frame, int], Frame]
Held = tuple[tuple[CameraInfo, ...], list[FrameSet]]
"""A cup that is held: its cameras and frames."""


@pytest.fixture(scope="module", params=[DEFAULT_WARNING, CUP_POUR])
def bundle(request: pytest.FixtureRequest) -> GraspBundle:
    return read_grasp_bundle(shipped_bundle(request.param))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"width": 640, "height": 640}, "640×640 from 'left'; let the camera send that size"),
        ({"width": 160, "height": 120}, "320×240, or larger ones of that shape; got 160×120"),
        ({"rate_hz": 12.5}, "18 to 75 frames/s; got 12.5 from 'left'; let the camera send that"),
        ({"rate_hz": 76.0}, "18 to 75 frames/s; got 76"),
        ({"width": 640, "height": 480}, ""),
        ({"width": 3280, "height": 2464}, ""),
        ({"rate_hz": 25.0}, ""),
        ({"rate_hz": 75.0}, ""),
    ],
)
def test_other_sizes_and_rates_are_refused_as_the_guide_says(
    bundle: GraspBundle, given: dict[str, float], words: str
):
    """Stock GelSight Minis send 25 frames a second, of 3280 × 2464 pixels or scaled down."""
    size = {"width": 320, "height": 240, "rate_hz": 60.0} | given
    cameras = tuple(CameraInfo(name=name, **size) for name in ("left", "right"))  # type: ignore[arg-type]
    refused = pytest.raises(BadBundle, match=f"{words}.*taxel train-monitor")
    with refused if words else nullcontext():
        bundle.contract.check_cameras(cameras)


@pytest.fixture(scope="module")
def all_held(few_pours: Path) -> list[Held]:
    """Three cups that are held with 50 N."""
    pours = [p for p in read_camera_recordings(few_pours) if p.groups["force_n"] == "50"]
    return [(pour.cameras, list(frame_sets(pour.path, 2))) for pour in pours]


@pytest.fixture(scope="module")
def held(all_held: list[Held]) -> Held:
    return all_held[0]


def watch(bundle: GraspBundle, held: Held, fault: Fault) -> list[GraspAnswer]:
    """Return the answers to frames of which the right camera's have a fault from `GOOD` on."""
    cameras, sets = held
    monitor, answers = GraspMonitor(bundle, cameras), []
    for number, found in enumerate(sets):
        left, right = found.frames
        if number >= GOOD:
            found = FrameSet((left, fault(right, number)))
        answers.append(monitor.push(found))
    return answers


def image_of(make: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Fault:
    """Return the fault that shows another image, of 25 different ones a second."""

    def fault(frame: Frame, number: int) -> Frame:
        random = np.random.default_rng(number * 25 // 60)
        image = make(decode_jpeg(frame.jpeg, None), random)
        return replace(frame, jpeg=encode_jpeg(np.clip(image, 0, 255).astype(np.uint8)))

    return fault


def dark(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return random.normal(4, 2, image.shape)


def noise(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return random.normal(128, 40, image.shape)


def covered(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return np.full(image.shape, random.integers(60, 200))


def another_gel(image: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return np.asarray(cv2.flip(image, 0), float) + random.normal(0, 2, image.shape)


FAULTS: dict[str, Fault] = {
    "dark": image_of(dark), "noise": image_of(noise), "covered": image_of(covered),
    "another gel": image_of(another_gel),
    "cut": lambda frame, _: replace(frame, jpeg=frame.jpeg[:500]),
    "empty": lambda frame, _: replace(frame, jpeg=b""),
    "a clock that was set back": lambda frame, _: replace(frame, device_s=frame.device_s - 100.0),
    "a clock that stands still": lambda frame, _: replace(frame, device_s=0.7),
}  # fmt: skip


def test_a_cup_that_is_held_is_stable_once_it_has_settled(bundle, held) -> None:
    states = [answer.decision.state for answer in watch(bundle, held, lambda frame, _: frame)]

    assert set(states[:23]) == {Stability.UNKNOWN}
    assert set(states[24:]) == {Stability.STABLE}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_what_cannot_be_followed_is_never_stable(bundle, held, name: str) -> None:
    """0.2 s after a fault at the latest."""
    answers = watch(bundle, held, FAULTS[name])
    late = [answer.decision for answer in answers[GOOD + 14 :]]

    assert answers[GOOD - 1].decision.state is Stability.STABLE
    assert len(late) > 20
    assert Stability.STABLE not in {decision.state for decision in late}
    doubts = {kind_of(d.reason) for d in late if d.state is Stability.UNKNOWN}
    shown = {"exchanged"} if name in ("noise", "covered", "another gel") else set()
    assert doubts <= (shown or {"slip lost", "bad image", "frozen"})
    lost = [d for d in late if kind_of(d.reason) in ("slip lost", "exchanged")]
    assert not any(d.slip.seen for d in lost if d.slip is not None)


def shifted(right: int, down: int) -> Callable[[np.ndarray], np.ndarray]:
    to = np.array([[1, 0, right], [0, 1, down]], np.float32)
    return lambda image: cv2.warpAffine(image, to, image.shape[1::-1], borderMode=cv2.BORDER_WRAP)


EXCHANGES: dict[str, Callable[[np.ndarray], np.ndarray] | int] = {
    "mirrored top to bottom": lambda image: image[::-1],
    "mirrored left to right": lambda image: image[:, ::-1],
    "turned by half": lambda image: image[::-1, ::-1],
    "shifted sideways": shifted(20, 0),
    "shifted down": shifted(0, 20),
    "another cup": 1,
    "a third cup": 2,
}
"""What becomes of an image; or how many cups further it is taken from."""


@pytest.mark.slow
@pytest.mark.parametrize("cup", range(3))
@pytest.mark.parametrize("way", list(EXCHANGES))
def test_an_image_that_is_exchanged_is_unknown_until_the_earlier_is_back(
    bundle, all_held, way: str, cup: int
) -> None:
    """Three images take 8 frames; an alarm that the first two raise stays on for its second."""
    how = EXCHANGES[way]

    def fault(frame: Frame, number: int) -> Frame:
        if number >= BACK:
            return frame
        if isinstance(how, int):
            other = all_held[(cup + how) % 3][1][number].frames[1]
            return replace(frame, jpeg=other.jpeg)
        image = np.ascontiguousarray(how(decode_jpeg(frame.jpeg, None)))
        return replace(frame, jpeg=encode_jpeg(image))

    decisions = [answer.decision for answer in watch(bundle, all_held[cup], fault)]
    away, again = decisions[GOOD + 8 : BACK], decisions[BACK + 9 :]

    assert decisions[GOOD - 1].state is Stability.STABLE
    assert all(d.alarm or kind_of(d.reason) == "exchanged" for d in away)
    assert not any(d.slip.seen for d in away)
    assert all(d.alarm or d.state is Stability.STABLE for d in again)
    assert all(d.slip.seen and d.slip.distance_mm < 0.05 for d in again)


def test_a_feature_that_is_no_number_gives_no_score(bundle) -> None:
    """Its trees would take NaN one way at each fork, and come to a number."""
    window = np.zeros((1, *bundle.offset.shape), np.float32)
    assert 0 <= bundle.probability(window) < 0.5

    window[0, 0, 7] = np.nan
    assert np.isnan(bundle.probability(window))
