"""Images whose copies are drawn where the student learns: a processor stands in for the card."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.errors import BadDataset
from taxel.models.torch_engine import TorchEngine
from taxel.training.backbones import fresh_transfer_set
from taxel.training.backbones.fresh_transfer_set import changed_there, gather_fresh
from taxel.training.backbones.touch_images import ImageSource, changed
from taxel.training.backbones.transfer_set import TransferConfig

CONFIG = TransferConfig(side_px=32, frames=2, copies=3, seed=1)
CPU = torch.device("cpu")


class Colours(nn.Module):
    """Answers with the mean colours."""

    def forward(self, images: Tensor) -> Tensor:
        return images.float().mean(dim=(1, 2))


def image(number: int) -> NDArray[np.uint8]:
    """Return a slope of grey in each direction, in one colour each, with a bright corner."""
    down, across = np.mgrid[0:240, 0:320]
    found = np.stack([down, across * 0.7, np.full((240, 320), 40 * number % 200)], axis=2)
    found[:30, :40] = 250
    return found.astype(np.uint8)


def video(number: int) -> ImageSource:
    def images(count: int) -> Iterator[NDArray[np.uint8]]:
        for index in range(count):
            yield image(2 * number + index)

    return ImageSource(f"v-{number}", f"set/{number}", images)


def test_the_first_copy_is_the_image_itself_and_each_is_answered_as_it_is_shown() -> None:
    examples = gather_fresh([video(0), video(1)], TorchEngine(Colours(), CPU), "colours", CONFIG)
    assert len(examples) == 12
    images, answers = examples.take(np.arange(12), 0)
    assert images.shape == (12, 3, 32, 32)
    for row in (0, 3, 6, 9):
        wanted = image(row // 3).mean(axis=(0, 1))
        assert np.abs(answers[row].numpy() - wanted).max() < 0.1
    assert (images.mean(dim=(2, 3)) - answers).abs().max() < 8


def test_copies_are_others_in_another_epoch_and_the_same_in_the_same() -> None:
    examples = gather_fresh([video(0)], TorchEngine(Colours(), CPU), "colours", CONFIG)
    first, again, other = (examples.take(np.arange(6), epoch)[0] for epoch in (0, 0, 1))
    assert torch.equal(first, again)
    assert torch.equal(first[::3], other[::3])
    assert not any(torch.equal(first[row], other[row]) for row in (1, 2, 4, 5))
    assert first.round().equal(first)


@pytest.mark.parametrize("part", [[0], [0, 3], [3, 9]])
def test_a_part_may_hold_no_changed_copy(part: list[int]) -> None:
    examples = gather_fresh([video(0), video(1)], TorchEngine(Colours(), CPU), "colours", CONFIG)
    images, _ = examples.take(np.array(part), 0)
    assert len(images) == len(part)


def test_a_sum_tells_other_images_and_settings_apart() -> None:
    engine = TorchEngine(Colours(), CPU)
    sums = {
        gather_fresh(videos, engine, key, config).digest()
        for videos in ([video(0)], [video(1)])
        for key in ("a", "b")
        for config in (CONFIG, TransferConfig(side_px=32, frames=2, copies=3, seed=2))
    }
    assert len(sums) == 8


def test_no_images_are_refused() -> None:
    empty = ImageSource("v", "set/v", lambda _count: iter(()))
    with pytest.raises(BadDataset, match="videos with images"):
        gather_fresh([empty], TorchEngine(Colours(), CPU), "colours", CONFIG)


def still(monkeypatch: pytest.MonkeyPatch, **kept: object) -> None:
    """Switch every change off but those that are named."""
    off: dict[str, object] = {"CUT": (1.0, 1.0), "TURN_DEG": 0.0, "GAMMA": 0.0, "LIGHT": 0.0,
                              "COLOUR": 0.0, "CONTRAST": 0.0, "NEGATIVE": 0.0, "BLURRED": 0.0,
                              "NOISE": 0.0}  # fmt: skip
    for name, value in (off | kept).items():
        monkeypatch.setattr(fresh_transfer_set, name, value)


def shown(count: int = 24, seed: int = 3) -> NDArray[np.uint8]:
    images = torch.from_numpy(np.stack([image(1)] * count))
    return np.asarray(changed_there(images, torch.Generator().manual_seed(seed)).numpy())


def test_without_changes_only_sides_and_colours_are_exchanged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    still(monkeypatch)
    source = image(1)
    turned = [source[a, b] for a in (slice(None), slice(None, None, -1))
              for b in (slice(None), slice(None, None, -1))]  # fmt: skip
    met = set()
    for found in shown():
        differences = [np.abs(np.sort(found, axis=2).astype(int) - np.sort(each, axis=2)).max()
                       for each in turned]  # fmt: skip
        assert min(differences) <= 1
        met.add(int(np.argmin(differences)))
    assert met == {0, 1, 2, 3}


def test_turned_images_keep_their_distances(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pixels stay square: what lies 60 from the middle still does."""
    still(monkeypatch)
    monkeypatch.setattr(fresh_transfer_set, "TURN_DEG", 90.0)
    dot = np.zeros((1, 240, 320, 3), np.uint8)
    dot[0, 118:123, 218:223] = 255  # 60.5 to the right of the middle
    for seed in range(12):
        found = changed_there(torch.from_numpy(dot), torch.Generator().manual_seed(seed)).numpy()
        down, across = np.argwhere(found[0, ..., 0] > 128).mean(axis=0)
        assert np.hypot(down - 119.5, across - 159.5) == pytest.approx(60.5, abs=1.5)


def test_blur_and_grain_and_light_do_what_their_names_say(monkeypatch: pytest.MonkeyPatch) -> None:
    def edges(images: NDArray[np.uint8]) -> float:
        return float(np.abs(np.diff(images.astype(float), axis=2)).max(axis=(1, 2, 3)).mean())

    still(monkeypatch)
    sharp, plain = edges(shown()), shown()
    still(monkeypatch, BLURRED=1.0)
    assert edges(shown()) < 0.7 * sharp
    still(monkeypatch, NOISE=0.05)
    grain = shown().astype(float) - plain
    assert 2 < grain.std() < 0.05 * 255
    still(monkeypatch, LIGHT=0.2)
    assert shown().mean(axis=(1, 2, 3)).std() > 3 * plain.mean(axis=(1, 2, 3)).std()
    still(monkeypatch, NEGATIVE=1.0)
    assert np.abs(shown().mean() + plain.mean() - 255) < 1


def test_copies_are_spread_as_those_that_a_processor_draws() -> None:
    """Means and deviations over many copies of both ways."""
    here = np.stack([changed(image(1), np.random.default_rng(n)) for n in range(150)])
    there = shown(150)
    for measure in (np.mean, np.std):
        first, second = (measure(copies, axis=(1, 2, 3)) for copies in (here, there))
        far = 4 * np.hypot(first.std(), second.std()) / np.sqrt(150)
        assert abs(first.mean() - second.mean()) < far
