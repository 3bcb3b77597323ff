"""Images of touch with a teacher's answers: objects apart, copies drawn once, answers kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.training.backbones import transfer_set as transfer_set_module
from taxel.training.backbones.touch_images import ImageSource, changed, find_videos, split_objects
from taxel.training.backbones.transfer_set import TransferConfig, gather_transfer_set

CONFIG = TransferConfig(side_px=32, frames=3, copies=2, seed=1)


def _video(name: str, number: int = 0) -> ImageSource:
    def images(count: int) -> Iterator[NDArray[np.uint8]]:
        for index in range(count):
            draw = np.random.default_rng([number, index])
            yield draw.integers(0, 256, (240, 320, 3), np.uint8)

    return ImageSource(f"{name}-{number}", name, images)


class Teacher:
    """Answers with the mean colours, and counts what it was asked."""

    key, features, in_order, places = "teacher", 3, False, False

    def __init__(self) -> None:
        self.asked = 0

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        self.asked += len(images)
        return np.stack(images).mean(axis=(1, 2)).astype(np.float32)


def _avi(path: Path, frames: int = 12) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (320, 240))
    for number in range(frames):
        video.write(np.full((240, 320, 3), (10, 20 * number, 200), np.uint8))
    video.release()


def test_no_object_is_on_both_sides_and_one_in_five_of_each_set_is_kept() -> None:
    videos = [_video(f"{folder}/{at}", n) for folder in "ab" for at in range(10) for n in range(3)]

    learn, kept = split_objects(videos)

    assert not {video.object for video in learn} & {video.object for video in kept}
    assert len(learn) + len(kept) == len(videos)
    for folder in "ab":
        assert len({v.object for v in kept if v.object.startswith(folder)}) == 2


def test_too_few_objects_are_refused() -> None:
    with pytest.raises(BadDataset, match="at least 5 objects"):
        split_objects([_video(f"a/{at}") for at in range(4)])


def test_the_published_folder_of_gelsight_slip_is_read_in_place(tmp_path: Path) -> None:
    for name in ("bottle", "rope"):
        for camera in ("camera_0.avi", "camera_2.avi"):
            _avi(tmp_path / "set" / "trials" / name / "exp_num_1" / camera)

    videos = find_videos(tmp_path / "set")
    images = list(videos[0].images(4))

    assert [video.object for video in videos] == ["set/bottle"] * 2 + ["set/rope"] * 2
    assert [round(float(image[..., 1].mean()) / 20) for image in images] == [0, 3, 7, 11]
    assert images[0][..., 0].mean() > 150  # red first


def test_recordings_give_different_images_over_their_whole_time(few_pours: Path) -> None:
    videos = find_videos(few_pours)
    images = list(videos[0].images(5))

    assert videos[0].object.startswith(f"{few_pours.name}/")
    assert len({image.tobytes() for image in images}) == len(images) == 5
    assert all(image.shape == (240, 320, 3) for image in images)


def test_a_changed_copy_is_another_image_of_the_same_size_and_the_same_one_for_the_same_draw() -> (
    None
):
    image = next(iter(_video("a").images(1)))
    first, again, other = (changed(image, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first.shape == image.shape
    assert first.dtype == np.uint8
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert not np.array_equal(first, image)


def test_each_image_comes_with_the_answer_to_it_as_the_teacher_saw_it(tmp_path: Path) -> None:
    examples = gather_transfer_set([_video("a"), _video("b", 1)], Teacher(), CONFIG, tmp_path)

    assert examples.images.shape == (12, 32, 32, 3)
    assert examples.plain.tolist() == [True, False] * 6
    images = examples.images[np.arange(12)]
    assert np.abs(images.mean(axis=(1, 2)) - examples.answers).max() < 8
    assert np.array_equal(examples.images[np.array([7, 2])], images[[7, 2]])
    assert not list((tmp_path / "examples").iterdir()), "its file has no name"


def test_answers_are_asked_for_once_and_a_call_that_was_broken_off_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transfer_set_module, "CHUNK", 4)
    videos = [_video("a"), _video("b", 1)]

    class Tired(Teacher):
        def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
            if self.asked >= 8:
                raise RuntimeError("broken off")
            return super().of(images)

    with pytest.raises(RuntimeError):
        gather_transfer_set(videos, Tired(), CONFIG, tmp_path)
    second, third = Teacher(), Teacher()
    whole = gather_transfer_set(videos, second, CONFIG, tmp_path)
    again = gather_transfer_set(videos, third, CONFIG, tmp_path)

    assert (second.asked, third.asked) == (4, 0)
    assert whole.digest() == again.digest()
    other = TransferConfig(side_px=32, frames=3, copies=2, seed=2)
    assert gather_transfer_set(videos, Teacher(), other, tmp_path).digest() != whole.digest()
