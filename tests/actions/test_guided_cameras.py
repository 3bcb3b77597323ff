"""A camera that falls silent ends a guided trial in one line that names it, whatever others do."""

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import pytest

from taxel.actions.guided_trials import RecordedTrial, record_trial
from taxel.errors import BadSource
from taxel.frame_codec import encode_jpeg
from taxel.recordings.manifest import NO_ARRAY
from taxel.recordings.reader import read_recording
from taxel.recordings.trial_plan import PlannedTrial
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo

RATE_HZ = 20.0
CUP = PlannedTrial(number=1, labels={"person": "a"}, groups={"cup": "mug"})
STILL = encode_jpeg(np.full((24, 32, 3), 90, np.uint8))


class Pair:
    """Two cameras that see nothing move; a camera may deliver less, or nothing for a while.

    Args:
        gone_s: From when the right camera is silent, seconds.
        back_s: From when it delivers again, seconds.
        every: It delivers one image of so many.
        empty: So many reads give nothing at first.
    """

    def __init__(
        self, gone_s: float = np.inf, back_s: float = np.inf, every: int = 1, empty: int = 0
    ) -> None:
        self._empty = empty
        self.cameras = tuple(
            CameraInfo(name=name, width=32, height=24, rate_hz=RATE_HZ)
            for name in ("left", "right")
        )
        self._gone_s, self._back_s, self._every = gone_s, back_s, every
        self.now_s = 0.0
        self._count = 0
        self._given: list[Frame] = []

    @property
    def info(self) -> SensorInfo:
        return NO_ARRAY

    @property
    def ended(self) -> bool:
        return False

    def read(self, timeout_s: float = 0.1) -> Samples:
        del timeout_s
        if self._empty:
            self._empty -= 1
            return Samples.empty(0)
        self.now_s = self._count / RATE_HZ
        right = not self._gone_s <= self.now_s < self._back_s and self._count % self._every == 0
        self._given = [
            Frame(camera=number, jpeg=STILL, counter=self._count, device_s=self.now_s,
                  arrival_s=self.now_s, fitted_s=self.now_s)
            for number in ((0, 1) if right else (0,))
        ]  # fmt: skip
        self._count += 1
        return Samples.empty(0)

    def frames(self) -> list[Frame]:
        given, self._given = self._given, []
        return given

    def marks(self) -> list[Mark]:
        return []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Nothing to close."""


def recorded(pair: Pair, folder: Path) -> RecordedTrial | None:
    """Record 2 s; end after a minute of the source's time, so that a hang fails and ends."""
    return record_trial(pair, CUP, folder / CUP.file_name, 2.0, stopped=lambda: pair.now_s > 60.0)


@pytest.mark.parametrize("gone_s", [0.0, 0.1, 1.0, 2.0])
def test_a_camera_gone_for_five_seconds_is_named(gone_s: float, tmp_path: Path):
    """Before the first frame, while the grasp settles, while it is recorded."""
    pair = Pair(gone_s)
    with pytest.raises(BadSource, match="got nothing from the right camera for 5 s; check its"):
        recorded(pair, tmp_path)

    assert pair.now_s == pytest.approx(gone_s + 5.0, abs=0.11)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("gone_s", [0.1, 1.0])
def test_a_camera_that_comes_back_in_time_goes_on(gone_s: float, tmp_path: Path):
    found = recorded(Pair(gone_s, gone_s + 4.5), tmp_path)

    assert found is not None
    assert found.frames > 40


def test_a_camera_far_below_its_rate_cannot_show_that_a_grasp_is_still(tmp_path: Path):
    """A frame each 4 s: the other camera's are kept for ten seconds, and no longer."""
    pair = Pair(every=80)
    with pytest.raises(BadSource, match=r"within 10 s .*; got too few of the right camera"):
        recorded(pair, tmp_path)

    assert pair.now_s == pytest.approx(10.0, abs=0.11)


@pytest.mark.parametrize("empty", [0, 1, 3])
def test_with_both_cameras_there_a_trial_is_recorded(empty: int, tmp_path: Path):
    """Also where the first reads give nothing, as just after cameras are opened."""
    found = recorded(Pair(empty=empty), tmp_path)

    assert found is not None
    assert found.frames == 80


def test_a_mark_of_the_trial_before_is_none_of_this_one(tmp_path: Path):
    """A source that stays open gives the last trial's mark once the next is being recorded."""

    class Marking(Pair):
        given = False

        def marks(self) -> list[Mark]:
            given, self.given = self.given, True
            spans = () if given else ((-5.0, -0.5), (0.0, 1.9), (2.5, 4.0))
            return [Mark(start_s=start, end_s=end, labels={}) for start, end in spans]

    assert recorded(Marking(), tmp_path) is not None
    marks = read_recording(tmp_path / CUP.file_name).marks
    assert [(mark.start_s, mark.end_s) for mark in marks] == [(0.0, 1.9)]
