"""A student learns a teacher's answers; a run that was broken off ends as an unbroken one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.errors import BadInput
from taxel.models.backbones.keras_layers import KerasClassifier, batch_norm
from taxel.training.backbones.distilling import (
    DistilConfig,
    _mean_loss,
    agreement,
    begin,
    distil,
    fit_top,
    resized,
    settle_norms,
)
from taxel.training.backbones.fine_tuning import KeptEpochs
from taxel.training.backbones.transfer_set import TransferSet

CONFIG = DistilConfig(epochs=3, batch=16, learning_rate=3e-3, seed=4)


class Small(nn.Module):
    """A network of images with a 1000-way top."""

    def __init__(self, seed: int, width: int = 12) -> None:
        super().__init__()
        torch.manual_seed(seed)
        self.first = nn.Conv2d(3, width, 5, stride=3)
        self.norm = batch_norm(width, 1e-3)
        self.predictions = KerasClassifier(width, 1000, "logits")

    def forward(self, images: Tensor) -> Tensor:
        logits: Tensor = self.predictions(self.norm(self.first(images / 255)).relu())
        return logits


class Broken(Exception):
    """The training was broken off."""


def _images(count: int, seed: int) -> NDArray[np.uint8]:
    """Return blobs of one colour on another."""
    draw = np.random.default_rng(seed)
    images = np.repeat(draw.integers(0, 256, (count, 1, 1, 3), np.uint8), 16, 1).repeat(16, 2)
    images[:, 4:10, 4:10] = draw.integers(0, 256, (count, 1, 1, 3), np.uint8)
    return images


def _examples(count: int = 90, seed: int = 0) -> TransferSet:
    """Return images answered by a network that sees colours, so that answers differ."""
    teacher = Small(7).eval()
    with torch.no_grad():
        usual, answers = (
            teacher(torch.from_numpy(images).permute(0, 3, 1, 2).float()).numpy()
            for images in (_images(200, 99), _images(count, seed))
        )
    answers = (answers - usual.mean(axis=0)) / usual.std(axis=0) * 3
    return TransferSet(_images(count, seed), answers, np.arange(count) % 2 == 0)


@pytest.mark.slow
def test_a_student_agrees_more_often_after_learning_and_on_images_it_never_saw() -> None:
    examples, unseen = _examples(300), _examples(200, seed=1)
    student = Small(1)
    before = agreement(student, unseen, plain=True)

    losses = distil(student, examples, DistilConfig(epochs=12, batch=16, learning_rate=3e-3))

    after = agreement(student, unseen, plain=True)
    assert losses[-1].loss < losses[0].loss
    assert after.share > before.share + 0.3
    assert after.share > after.commonest + 0.2


def test_the_closed_form_finds_a_top_that_is_there_to_be_found() -> None:
    """A student with the teacher's own features gives its logits before any epoch."""
    examples = _examples(400)
    student = Small(7)
    nn.init.normal_(student.predictions.weight)
    norm = {key: value.clone() for key, value in student.norm.state_dict().items()}

    fit_top(student, examples, CONFIG)

    assert all(torch.equal(value, student.norm.state_dict()[key]) for key, value in norm.items())
    with torch.no_grad():
        images = torch.from_numpy(examples.images).permute(0, 3, 1, 2).float()
        rest = torch.from_numpy(examples.answers) - student(images)
    wanted = torch.from_numpy(examples.answers)
    assert rest.square().mean() < 0.1 * (wanted - wanted.mean(dim=0)).square().mean()


def test_normalisation_takes_the_statistics_of_these_images() -> None:
    examples, student = _examples(96), Small(1)

    settle_norms(student, examples, CONFIG)

    with torch.no_grad():
        maps = student.first(torch.from_numpy(examples.images).permute(0, 3, 1, 2).float() / 255)
    assert torch.allclose(student.norm.running_mean, maps.mean(dim=(0, 2, 3)), atol=1e-4)


def _answered_by(teacher: Small, count: int = 96) -> TransferSet:
    images = _images(count, 3)
    with torch.no_grad():
        answers = teacher.eval()(torch.from_numpy(images).permute(0, 3, 1, 2).float()).numpy()
    return TransferSet(images, answers, np.arange(count) % 2 == 0)


def test_a_start_that_gives_its_teachers_answers_stays_as_it_is_and_keeps_its_norms(
    tmp_path: Path,
) -> None:
    """As ResNet101 that is its teacher with idle blocks: statistics of touch would spoil it."""
    teacher, student = Small(7), Small(7)
    examples = _answered_by(teacher)
    before = {key: value.clone() for key, value in student.state_dict().items()}

    assert begin(student, examples, CONFIG)
    assert all(torch.equal(before[key], value) for key, value in student.state_dict().items())

    kept = KeptEpochs(tmp_path / "s.checkpoint")
    whole = distil(student, examples, CONFIG)
    done: list[int] = []

    def look(step: int, _of: int, _loss: float) -> None:
        done.append(step)
        if step == len(examples) // CONFIG.batch + 2 and len(done) == step:
            raise Broken

    with pytest.raises(Broken):
        distil(Small(7), examples, CONFIG, kept=kept, on_step=look)
    resumed = Small(1)  # the checkpoint says that norms were kept, not the network that goes on

    assert distil(resumed, examples, CONFIG, kept=kept, on_step=look) == whole
    for trained in (student, resumed):
        assert torch.equal(trained.norm.running_mean, before["norm.running_mean"])
        assert agreement(trained, examples, plain=True).share > 0.95
    assert all(epoch.norms_kept for epoch in whole)
    # Adam moves a number by about its step size: a tenth of the largest one, rising and falling.
    moved = (student.first.weight - before["first.weight"]).abs().max()
    assert 0 < moved < 0.1 * CONFIG.learning_rate * CONFIG.epochs * (len(examples) // CONFIG.batch)


def test_a_start_is_judged_by_each_of_its_images_once() -> None:
    """A last batch that is not full weighs as many as it holds."""
    examples, student = _answered_by(Small(7)), Small(1).eval()
    rows = np.arange(70)  # 64, then 6
    each = [_mean_loss(student, examples, CONFIG, rows[i : i + 1]) for i in rows]

    assert _mean_loss(student, examples, CONFIG, rows) == pytest.approx(np.mean(each), rel=1e-5)


def test_another_start_takes_the_statistics_of_touch_and_a_fitted_top() -> None:
    student = Small(1)
    before = student.norm.running_mean.clone()
    assert not begin(student, _answered_by(Small(7)), CONFIG)
    assert not torch.equal(student.norm.running_mean, before)


def test_the_closed_form_says_how_far_it_is() -> None:
    """It sees most images once, which takes minutes: silence would look like a hang."""
    calls: list[tuple[int, int]] = []
    distil(Small(3), _examples(), CONFIG, on_fit=lambda done, of: calls.append((done, of)))
    assert [of for _, of in calls] == [81] * len(calls)
    assert (calls[0][0], calls[-1][0]) == (64, 81)


def test_agreement_counts_first_answers_and_the_commonest() -> None:
    answers = np.zeros((5, 1000), np.float32)
    answers[range(5), [3, 3, 3, 8, 9]] = 1

    class Always(nn.Module):
        def forward(self, images: Tensor) -> Tensor:
            return torch.nn.functional.one_hot(torch.full((len(images),), 8), 1000).float()

    examples = TransferSet(
        np.zeros((5, 8, 8, 3), np.uint8), answers, np.array([1, 1, 0, 1, 1], bool)
    )
    found = agreement(Always(), examples, plain=True)
    assert (found.share, found.commonest, found.images) == (0.25, 0.5, 4)


@pytest.mark.parametrize("break_at", [3, 8, 14])
def test_a_run_broken_off_loses_one_epoch_at_most_and_ends_as_an_unbroken_one(
    break_at: int, tmp_path: Path
) -> None:
    examples = _examples()
    kept = KeptEpochs(tmp_path / "s.checkpoint")
    whole = Small(1)
    losses = distil(whole, examples, CONFIG)
    done: list[int] = []

    def look(step: int, _of: int, _loss: float) -> None:
        done.append(step)
        if len(done) == break_at:
            raise Broken

    with pytest.raises(Broken):
        distil(Small(1), examples, CONFIG, kept=kept, on_step=look)
    again = Small(2)
    resumed = distil(again, examples, CONFIG, kept=kept, on_step=look)

    steps = len(examples) // CONFIG.batch
    assert done[break_at] == break_at // steps * steps + 1
    assert len(done) - CONFIG.epochs * steps < steps
    if break_at >= steps:
        assert resumed == losses
        other = again.state_dict()
        assert all(torch.equal(other[key], value) for key, value in whole.state_dict().items())


def test_a_checkpoint_of_other_images_is_refused(tmp_path: Path) -> None:
    kept = KeptEpochs(tmp_path / "s.checkpoint")
    distil(Small(1), _examples(), CONFIG, kept=kept)
    with pytest.raises(BadInput, match="other data"):
        distil(Small(1), _examples(seed=5), CONFIG, kept=kept)


def test_a_loss_that_is_no_number_ends_the_training_and_writes_nothing(tmp_path: Path) -> None:
    lost = Small(1)
    nn.init.constant_(lost.first.weight, float("nan"))
    kept = KeptEpochs(tmp_path / "s.checkpoint")
    with pytest.raises(BadInput, match="nan in step 1"):
        distil(lost, _examples(), CONFIG, kept=kept)
    assert not kept.path.exists()


def test_normalisation_takes_enough_images_whatever_a_step_holds() -> None:
    examples = _examples(96)
    few, many = Small(1), Small(1)
    settle_norms(few, examples, DistilConfig(batch=2, seed=4))
    settle_norms(many, examples, DistilConfig(batch=32, seed=4))
    assert torch.equal(few.norm.running_var, many.norm.running_var)


def test_a_gradient_that_is_no_number_changes_no_weight(tmp_path: Path) -> None:
    """A loss may be a number although its gradient is none."""

    class Rooted(Small):
        def forward(self, images: Tensor) -> Tensor:
            zero = self.first.weight.sum() * 0
            logits = super().forward(images)
            return logits + zero.sqrt() if self.training else logits

    student, examples = Rooted(1), _examples(64)
    kept = KeptEpochs(tmp_path / "s.checkpoint")
    with pytest.raises(BadInput, match="nan in step 1"):
        distil(student, examples, CONFIG, kept=kept)
    assert all(torch.isfinite(value).all() for value in student.state_dict().values())
    assert not kept.path.exists()


def test_each_size_of_images_is_used_for_an_equal_share_of_the_epochs() -> None:
    """In the order given, and the last one last; the passes before the first count for none."""
    sides: list[int] = []
    network = Small(1)
    network.first.register_forward_pre_hook(
        lambda module, inputs: sides.append(inputs[0].shape[-1]) if network.training else None
    )
    config = DistilConfig(epochs=4, sides_px=(8, 16), batch=45, learning_rate=3e-3)
    settled = len(range(0, 81, 45))  # batches that the norms take their statistics from

    distil(network, _examples(), config)

    assert sides[settled:] == [8] * 4 + [16] * 4


def test_smaller_images_hold_means_over_what_they_leave_out() -> None:
    """Of rows that are black and white in turn, every second one alone would be black or white."""
    images = torch.zeros(1, 3, 16, 16)
    images[:, :, ::2] = 255
    config = DistilConfig(epochs=2, sides_px=(8, 16))

    small = resized(images, config, 0)

    assert small.shape == (1, 3, 8, 8)
    assert float((small[:, :, 1:-1] - 127.5).abs().max()) < 1
    assert resized(images, config, 1) is images
    assert resized(images, DistilConfig(), 0) is images
