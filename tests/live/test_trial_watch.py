"""A camera trial that no mark ends: its memory and its looks stay as they were (0041)."""

from types import SimpleNamespace

import numpy as np
import pytest

from taxel.live import trial_watch
from taxel.live.trial_session import TrialTally
from taxel.live.trial_watch import TrialWatch
from taxel.signals import CameraInfo, Frame
from taxel.windows.pairs import FrameSet
from taxel.windows.trial_crops import Layout

KEPT = 20
CAMERA = CameraInfo(name="gel", width=8, height=8, rate_hz=25.0)


def watch_of(monkeypatch: pytest.MonkeyPatch, crop: int) -> TrialWatch:
    """A watch that keeps few frames, of a model that says how many crops it saw before."""
    contract = SimpleNamespace(
        classes=("full", "empty"), crop=crop, layout=Layout(crop, 3), sharpness=1.0,
        threshold=None, check=lambda *_: None,
    )  # fmt: skip
    crops = iter(range(10**6))
    answers = ((np.array([0.9, 0.1]), float(next(crops))) for _ in iter(int, 1))
    monkeypatch.setattr(trial_watch, "MOST_FRAMES", KEPT)
    monkeypatch.setattr(trial_watch, "decode_frame", lambda *_: np.zeros((8, 8, 3), np.uint8))
    monkeypatch.setattr(trial_watch, "predict_crop", lambda *_: next(answers))
    return TrialWatch(SimpleNamespace(contract=contract), (CAMERA,))  # type: ignore[arg-type]


def moment(number: int) -> FrameSet:
    time_s = number / 25.0
    frame = Frame(
        camera=0, jpeg=b"%d" % number, counter=number, device_s=time_s, arrival_s=time_s,
        fitted_s=time_s,
    )  # fmt: skip
    return FrameSet((frame,))


@pytest.mark.parametrize("crop", [1, 2, 8])
def test_a_trial_without_an_end_keeps_the_frames_of_one_crop(
    monkeypatch: pytest.MonkeyPatch, crop: int
) -> None:
    """Before, with crops of one frame every frame stayed: gigabytes an hour."""
    watch = watch_of(monkeypatch, crop)
    for number in range(10 * KEPT):
        found = moment(number)
        watch.see(found.frames[0])
        watch.push(found)
    assert [found.frames[0].counter for found in watch._sets] == list(
        range(10 * KEPT - crop, 10 * KEPT)
    )


def test_the_verdict_is_of_all_crops_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many there are, a look joins them at once: sums are kept, no crop."""
    watch = watch_of(monkeypatch, crop=1)
    sizes = []
    monkeypatch.setattr(
        watch,
        "_joined",
        lambda answers, own=watch._joined: sizes.append(len(answers)) or own(answers),
    )
    for number in range(KEPT):
        found = moment(number)
        watch.see(found.frames[0])
        answer = watch.push(found)
        assert (answer.verdict.label, answer.verdict.crops) == ("full", number + 1)
        assert answer.verdict.novelty == pytest.approx(number / 2)
    assert set(sizes) == {1}


def test_the_longest_look_is_known_though_only_the_latest_are_kept() -> None:
    tally, other = TrialTally("fill"), TrialTally("fill")
    tally.looked(3.0)
    for _ in range(10_001):
        other.looked(0.25)
    tally.take_in(other)
    assert len(tally.looks_s) == 10_000
    assert tally.summary()["look_ms_max"] == pytest.approx(3000.0)
    assert tally.summary()["look_ms_median"] == pytest.approx(250.0)
