"""A camera trial that no mark ends: its memory and its looks stay as they were (0041)."""

from dataclasses import replace
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.errors import BadSource
from taxel.live import trial_session, trial_watch
from taxel.live.trial_session import TrialTally, run_trial_session
from taxel.live.trial_watch import TrialAnswer, TrialWatch
from taxel.recordings.manifest import NO_ARRAY
from taxel.signals import CameraInfo, Frame, Mark, Samples
from taxel.windows.pairs import FrameSet
from taxel.windows.trial_layout import Layout
from taxel.windows.trial_stretch import changes_of, part_of

KEPT = 20
CAMERA = CameraInfo(name="gel", width=8, height=8, rate_hz=25.0)


def watch_of(
    monkeypatch: pytest.MonkeyPatch, crop: int, layout: Layout | None = None
) -> TrialWatch:
    """A watch that keeps few frames, of a model that says how many crops it saw before."""
    contract = SimpleNamespace(
        target="fill", classes=("full", "empty"), crop=crop, layout=layout or Layout(crop, 3),
        sharpness=1.0, weights={}, threshold=None, check=lambda *_: None,
    )  # fmt: skip
    crops = iter(range(10**6))
    answers = ((np.array([0.9, 0.1]), float(next(crops))) for _ in iter(int, 1))
    monkeypatch.setattr(trial_watch, "MOST_FRAMES", KEPT)
    monkeypatch.setattr(trial_watch, "decode_frame", lambda *_: np.zeros((8, 8, 3), np.uint8))
    monkeypatch.setattr(trial_watch, "predict_crop", lambda *_: next(answers))
    return TrialWatch(SimpleNamespace(contract=contract), (CAMERA,))  # type: ignore[arg-type]


def frame_of(camera: int, number: int) -> Frame:
    time_s = number / 25.0
    return Frame(
        camera=camera, jpeg=b"%d" % number, counter=number, device_s=time_s, arrival_s=time_s,
        fitted_s=time_s,
    )  # fmt: skip


def moment(number: int) -> FrameSet:
    return FrameSet((frame_of(0, number),))


class Cameras:
    """A source of two cameras that gives a frame of each a read, the right one's for a while."""

    info, cameras = NO_ARRAY, (replace(CAMERA, name="left"), replace(CAMERA, name="right"))

    def __init__(self, left: int, right: int, *, ends: bool) -> None:
        self.reads, self._counts, self._ends = 0, (left, right), ends

    @property
    def ended(self) -> bool:
        return self._ends and self.reads >= max(self._counts)

    def read(self, timeout_s: float = 0.1) -> Samples:
        self.reads += 1
        return Samples.empty(0)

    def frames(self) -> list[Frame]:
        number = self.reads - 1
        return [frame_of(own, number) for own, last in enumerate(self._counts) if number < last]

    def marks(self) -> list[Mark]:
        return []


@pytest.mark.parametrize("ends", [True, False])
def test_a_trial_of_which_a_camera_is_gone_is_unknown_then_and_at_its_end(
    monkeypatch: pytest.MonkeyPatch, ends: bool
) -> None:
    """Before, the last verdict stood as long as the other camera went on, and at the end."""
    bundle = watch_of(monkeypatch, crop=2).bundle
    answers: list[TrialAnswer] = []
    source = Cameras(left=14, right=9, ends=ends)
    tally = run_trial_session(
        source, bundle, on_answer=lambda answer, changed: changed and answers.append(answer),
        stopped=lambda: source.reads > 13,
    )  # fmt: skip
    assert [answer.verdict.label for answer in answers[-3:]] == ["full", "UNKNOWN", "UNKNOWN"]
    assert answers[-2].verdict.reason == "the right camera is gone: no frame for 120 ms"
    assert tally.trials[0]["reason"] == "the right camera is gone: no frame for 200 ms"


def test_a_frame_without_its_partner_at_the_end_changes_no_verdict(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = watch_of(monkeypatch, crop=2).bundle
    tally = run_trial_session(Cameras(left=10, right=9, ends=True), bundle)
    assert (tally.trials[0]["verdict"], tally.trials[0]["frames"]) == ("full", 9)


@pytest.mark.parametrize(("end", "frames", "label"), [(7, 4, "full"), (4, 1, "UNKNOWN")])
def test_what_was_seen_outside_of_a_trial_s_mark_is_no_part_of_its_verdict(
    monkeypatch: pytest.MonkeyPatch, end: int, frames: int, label: str
) -> None:
    """As in evaluation; before, the verdict took in all that came before the mark's end."""
    watch = watch_of(monkeypatch, crop=2)
    looks: list[list[int]] = []
    real = watch._crop
    monkeypatch.setattr(
        watch, "_crop",
        lambda sets: looks.append([own.frames[0].counter for own in sets]) or real(sets),
    )  # fmt: skip
    for number in range(12):
        watch.push(moment(number))
    looks.clear()

    answer = watch.finish(Mark(start_s=4 / 25.0, end_s=end / 25.0, labels={"fill": "full"}))

    assert answer is not None
    assert (answer.frames, answer.verdict.label) == (frames, label)
    assert looks == ([[4, 5], [5, 6], [6, 7]] if label == "full" else [])
    assert watch.finish() is None


def level_of(number: int) -> int:
    """Something before the sensor, rest, a touch from 30 to 55, and rest."""
    return 200 if number < 5 else 50 + 4 * min(max(number - 30, 0), 10) * (number < 55)


@pytest.mark.parametrize("step", [1, 3])
@pytest.mark.parametrize(("first", "last"), [(0, 79), (8, 79), (0, 50), (25, 60), (12, 40)])
def test_the_last_crops_are_those_of_evaluation_wherever_a_mark_cuts_the_trial(
    monkeypatch: pytest.MonkeyPatch, first: int, last: int, step: int
) -> None:
    """Before, differences were to the first moment seen, though it lay outside of the mark."""
    layout = Layout(5, 3, moving=True, step=step)
    watch = watch_of(monkeypatch, 5, layout)
    images = [np.full((8, 8, 3), level_of(number), np.uint8) for number in range(80)]
    monkeypatch.setattr(trial_watch, "MOST_FRAMES", 80)
    monkeypatch.setattr(trial_watch, "decode_frame", lambda jpeg, _: images[int(jpeg)])
    looks: list[int] = []
    real = watch._crop
    monkeypatch.setattr(
        watch, "_crop", lambda sets: looks.append(sets[0].frames[0].counter) or real(sets)
    )
    for trial in range(2):  # the second after a reset
        for number in range(80):
            watch.push(moment(number))
        looks.clear()
        watch.finish(Mark(start_s=first / 25.0, end_s=last / 25.0, labels={}))

        inside = images[first : last + 1]
        part = part_of(
            layout, len(inside), lambda own=inside: changes_of([(i,) for i in own], step)
        )
        assert looks == [first + at for at in layout.starts(part)], trial


def test_a_damaged_frame_outside_of_every_crop_s_images_leaves_the_trial_unknown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the crops lie depends on all frames; the reason stays until the trial is over."""
    watch = watch_of(monkeypatch, 3, Layout(3, 3, moving=True, step=3))

    def decode(jpeg: bytes, camera: CameraInfo) -> np.ndarray:
        if jpeg == b"4":
            raise BadSource("a JPEG", "a damaged frame", "look at the cable")
        return np.zeros((8, 8, 3), np.uint8)

    monkeypatch.setattr(trial_watch, "decode_frame", decode)
    reasons = [watch.push(moment(number)).verdict.reason for number in range(12)]
    assert reasons[4:] == ["a damaged frame"] * 8
    answer = watch.finish()
    assert answer is not None
    assert answer.verdict.reason == "a damaged frame"
    for number in range(5, 14):
        watch.push(moment(number))
    answer = watch.finish()
    assert answer is not None
    assert answer.verdict.label == "full"


def test_where_all_cameras_are_silent_the_verdict_is_unknown_and_the_seconds_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Before, the last verdict stood for ever: no frame came whose time could end it."""
    bundle = watch_of(monkeypatch, crop=2).bundle
    times = count(9)
    monkeypatch.setattr(trial_session, "monotonic", lambda: next(times) / 25.0)
    source = Cameras(left=9, right=9, ends=False)
    tally = run_trial_session(source, bundle, seconds=1.0, stopped=lambda: source.reads > 200)
    assert source.reads < 60
    assert tally.trials[0]["reason"].startswith("the left camera is gone")


@pytest.mark.parametrize(
    ("labels", "frames"),
    [({"fill": "full"}, [10, 8]), ({"outcome": "hold"}, [10, 8]), ({}, [10, 8]),
     ({"reaction": "put down"}, [18]), ({"reaction": "put down", "fill": "full"}, [18]),
     ({"shape": "ball"}, [18])],
)  # fmt: skip
def test_only_a_mark_of_a_trial_ends_it(
    monkeypatch: pytest.MonkeyPatch, labels: dict[str, str], frames: list[int]
) -> None:
    """A person's reaction, or a mark of the hand beside the cameras, cut it in two."""
    bundle = watch_of(monkeypatch, crop=2).bundle
    source = Cameras(left=18, right=18, ends=True)
    mark = Mark(start_s=0.0, end_s=9 / 25.0, labels=labels)
    monkeypatch.setattr(source, "marks", lambda: [mark] if source.reads == 10 else [])
    tally = run_trial_session(source, bundle)
    assert [trial["frames"] for trial in tally.trials] == frames


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
    real = trial_watch.join_crops
    monkeypatch.setattr(
        trial_watch, "join_crops", lambda own, *rest: sizes.append(len(own)) or real(own, *rest)
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
