"""Claims about kernel features: exact live and offline, blind to padding, and what they find."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.bundles.writer import export_onnx
from taxel.models.kernel_features import KernelFeatures, drawn_kernels, kernels_of
from taxel.models.onnx_session import WindowModel
from taxel.models.touch_features import compute_features
from taxel.training.choose.candidates import Candidate, feature_sets
from taxel.training.choose.fitting import fit_head, head_logits
from taxel.training.choose.kernels import KeptKernels, compute_kernels, fit_kernels
from taxel.training.choose.pieces import _Features

Windows = tuple[NDArray[np.float32], NDArray[np.bool_]]


def windows(steps: int, channels: int, count: int = 20, *, padded: bool = False) -> Windows:
    random = np.random.default_rng(steps + channels)
    values = random.normal(3.0, 1.0, (count, steps, channels)).cumsum(axis=1).astype(np.float32)
    rows = random.integers(steps // 2, steps + 1, count) if padded else np.full(count, steps)
    mask = np.arange(steps) < rows[:, None]
    return values * mask[:, :, None], mask


class _Alone(nn.Module):
    def __init__(self, kernels: KernelFeatures, *, padded: bool) -> None:
        super().__init__()
        self.kernels, self.padded = kernels, padded

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        found: Tensor = self.kernels(values, mask if self.padded else None)
        return found


@pytest.mark.parametrize(
    ("steps", "channels", "padded"),
    [(9, 1, False), (15, 6, False), (60, 12, True), (300, 3, True), (75, 40, False)],
)
def test_live_and_offline_count_the_same_places(steps: int, channels: int, padded: bool):
    values, mask = windows(steps, channels, padded=padded)
    kernels = fit_kernels(values, mask, padded=padded)
    offline = compute_kernels(kernels, values, mask, padded=padded)
    live = WindowModel(export_onnx(_Alone(kernels, padded=padded).eval(), steps, channels))

    for number in range(len(values)):
        answered = live(values[number : number + 1], mask[number : number + 1])
        np.testing.assert_array_equal(np.float32(answered).ravel(), offline[number])
    assert offline.min() >= 0.0
    assert offline.max() <= 1.0


@pytest.mark.parametrize("padded", [False, True])
def test_a_difference_of_channels_of_very_different_size_is_exact_too(padded: bool):
    """In double precision sums of pascals less volts were not: places were counted otherwise."""
    values, mask = windows(60, 6, padded=padded)
    values *= np.array([1e6, 1e-4] * 3, np.float32)
    kernels = fit_kernels(values, mask, padded=padded)
    offline = compute_kernels(kernels, values, mask, padded=padded)
    live = WindowModel(export_onnx(_Alone(kernels, padded=padded).eval(), 60, 6))

    answered = np.concatenate([np.float32(live(values[i : i + 1], mask[i : i + 1])).reshape(1, -1)
                               for i in range(len(values))])  # fmt: skip
    np.testing.assert_array_equal(answered, offline)


def test_kernels_are_minirockets_84_each_seen_once_at_each_dilation():
    for slots in (1, 12):
        for number in range(6):
            own = kernels_of(slots, number).reshape(-1, 9)
            assert len(np.unique(own, axis=0)) == 84
            assert (own.sum(axis=1) == 0.0).all()


def test_what_lies_in_padding_is_not_looked_at():
    values, mask = windows(60, 3, padded=True)
    kernels = fit_kernels(values, mask, padded=True)
    other = np.where(mask[:, :, None], values, np.float32(1e6))

    np.testing.assert_array_equal(
        compute_kernels(kernels, values, mask, padded=True),
        compute_kernels(kernels, other, mask, padded=True),
    )


def test_kernels_at_the_ends_see_the_level_and_all_others_do_not():
    flat = np.repeat(np.arange(-5.0, 6.0, dtype=np.float32)[:, None, None], 40, axis=1)
    mask = np.ones(flat.shape[:2], np.bool_)
    kernels = fit_kernels(flat, mask, padded=False)
    found = compute_kernels(kernels, flat, mask, padded=False)

    assert len(np.unique(found, axis=0)) > 5
    inside = kernels.answers(torch.from_numpy(flat), None, 0)[..., 4:-4]
    assert (inside == 0.0).all()


def test_the_length_of_a_trial_shows_no_more_than_in_plain_features():
    """Noise about a level, half of the trials half as long: its spread alone says something."""
    random = np.random.default_rng(1)
    values = random.normal(5.0, 1.0, (400, 80, 2)).astype(np.float32)
    y = np.arange(400) % 2
    mask = np.arange(80) < np.where(y, 80, 40)[:, None]
    values = values * mask[:, :, None]
    kernels = fit_kernels(values[:200], mask[:200], padded=True)
    seen = compute_kernels(kernels, values, mask, padded=True)
    plain = compute_features(feature_sets(80, 2, padded=True)["all"], (0, 0), values, mask)

    def right(model: Candidate, features: NDArray[np.float32]) -> float:
        head = fit_head(model, features[:200], y[:200], 2)
        return float((head_logits(head, features[200:]).argmax(axis=1) == y[200:]).mean())

    trees = Candidate("trees", "extra-trees", "", 2)
    sums = Candidate("discriminant", "winsorised-discriminant", "", 0.3)
    assert right(sums, seen) < 0.65 < right(sums, plain)
    assert right(trees, seen) < 0.9 < right(trees, plain)


def test_a_steady_pattern_is_the_same_however_long_it_lasts():
    """Pulses every four rows: of 40 rows and of 80 the same shares, but for two of 20 places."""
    values = np.zeros((2, 80, 1), np.float32)
    values[:, ::4] = 1.0
    mask = np.arange(80) < np.array([[40], [80]])
    random = np.random.default_rng(0)
    other = random.random((50, 80, 1)).astype(np.float32)
    kernels = fit_kernels(other, np.arange(80) < np.full((50, 1), 40), padded=True)
    short, long = compute_kernels(kernels, values * mask[:, :, None], mask, padded=True)

    assert len(kernels.place) == 20
    assert np.abs(short - long).mean() < 0.1


def test_a_pattern_is_found_that_no_plain_statistic_shows():
    """Pulses every three rows or every four, equally high and equally many, at any place."""
    random = np.random.default_rng(0)
    y = np.arange(200) % 2
    values = np.zeros((200, 120, 1), np.float32)
    for number, kind in enumerate(y):
        start = random.integers(20, 50)
        values[number, start : start + (3 + kind) * 10 : 3 + kind, 0] = 1.0
    mask = np.ones((200, 120), np.bool_)
    kernels = fit_kernels(values[:100], mask[:100], padded=False)
    seen = compute_kernels(kernels, values, mask, padded=False)
    head = fit_head(Candidate("trees", "extra-trees", "kernels", 2), seen[:100], y[:100], 2)

    assert (head_logits(head, seen[100:]).argmax(axis=1) == y[100:]).mean() > 0.95


def test_biases_come_from_the_windows_that_are_learned_from_alone():
    values, mask = windows(60, 4, 30)
    learned, every = np.arange(20), np.arange(30)
    kept = KeptKernels()
    first, seen = kept.of(values, mask, learned, every, padded=False, seed=0)
    changed = values.copy()
    changed[20:] *= 7.0
    second, _ = KeptKernels().of(changed, mask, learned, every, padded=False, seed=0)

    assert torch.equal(first.bias, second.bias)
    assert seen.shape == (30, first.bias.numel())
    assert kept.of(values, mask, learned, every, padded=False, seed=0)[0] is first
    assert kept.of(values, mask, every, every, padded=False, seed=0)[0] is not first


def test_features_that_are_timed_are_as_many_as_those_that_are_fitted():
    values, mask = windows(60, 5)
    prepared: Any = SimpleNamespace(pads=(0,) * 5, grids=(), config=SimpleNamespace(pad=False))
    timed = _Features(("mean", "kernels"), prepared, 60)
    found = timed(torch.from_numpy(values), torch.from_numpy(mask))

    assert found.shape[1] == 5 + fit_kernels(values, mask, padded=False).bias.numel()
    assert found.shape[1] == 5 + drawn_kernels(60, 5).bias.numel()


def test_half_of_the_slots_do_not_see_what_all_channels_have_in_common():
    values, mask = windows(60, 12)
    kernels = fit_kernels(values, mask, padded=False)
    drift = np.random.default_rng(7).normal(0.0, 5.0, (len(values), 60, 1)).astype(np.float32)
    shape = (len(values), *kernels.channel.shape, -1)
    calm = compute_kernels(kernels, values, mask, padded=False).reshape(shape)
    drifting = compute_kernels(kernels, values + drift, mask, padded=False).reshape(shape)
    changed = np.abs(drifting - calm).mean(axis=(0, 3))
    differences = (kernels.less >= 0).numpy()

    assert 0.3 < differences.mean() < 0.7
    assert changed[differences].max() < 0.01
    assert changed[~differences].min() > 0.02


def test_a_single_channel_has_no_differences_and_older_weights_have_none():
    assert (drawn_kernels(60, 1).less < 0).all()

    older = drawn_kernels(60, 3).state_dict()
    del older["less"]
    loaded = KernelFeatures()
    loaded.load_state_dict(older)

    assert loaded.less.shape == loaded.channel.shape
    assert (loaded.less < 0).all()
