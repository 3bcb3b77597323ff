"""Training is repeatable, and a broken run goes on as if it had not been broken."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.errors import BadInput
from taxel.models.cnn2d import Cnn2d
from taxel.training.augment import Augment
from taxel.training.curves import Epoch
from taxel.training.loop import Checkpoint, Labelled, TrainConfig, evaluate, fit, new_network

CONFIG = TrainConfig(epochs=4, batch=16, augment=Augment(noise=0.05, gain=0.1), weight_decay=0.01)


def data(n: int = 64) -> Labelled:
    rng = np.random.default_rng(0)
    values = rng.random((n, 6, 4), dtype=np.float32)
    return Labelled(values, np.ones((n, 6), bool), (values[:, 0, 0] > 0.5).astype(np.intp))


def network() -> torch.nn.Module:
    return new_network(lambda: Cnn2d(6, 4, 2), seed=3)


def weights(net: torch.nn.Module) -> list[torch.Tensor]:
    return [p.detach().clone() for p in net.parameters()]


class BrokenOffError(Exception):
    pass


def test_a_broken_run_resumes_to_the_same_weights(tmp_path: Path) -> None:
    unbroken = network()
    history = fit(unbroken, data(), CONFIG)

    def break_after_two(epoch: Epoch) -> None:
        if epoch.number == 2:
            raise BrokenOffError

    path = tmp_path / "run.safetensors"
    with pytest.raises(BrokenOffError):
        fit(network(), data(), CONFIG, checkpoint=Checkpoint(path), on_epoch=break_after_two)
    resumed = network()
    again = fit(resumed, data(), CONFIG, checkpoint=Checkpoint(path))

    assert again == history
    for a, b in zip(weights(unbroken), weights(resumed), strict=True):
        assert torch.equal(a, b)


def test_a_checkpoint_of_another_configuration_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.safetensors"
    fit(network(), data(), replace(CONFIG, epochs=1), checkpoint=Checkpoint(path))

    with pytest.raises(BadInput, match="another configuration"):
        fit(network(), data(), CONFIG, checkpoint=Checkpoint(path))


def test_a_damaged_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.safetensors"
    fit(network(), data(), CONFIG, checkpoint=Checkpoint(path))
    path.write_bytes(path.read_bytes()[:200])

    with pytest.raises(BadInput, match="damaged"):
        fit(network(), data(), CONFIG, checkpoint=Checkpoint(path))


def test_training_leaves_the_global_random_state_alone() -> None:
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    fit(network(), data(), CONFIG)

    assert torch.equal(torch.rand(3), expected)


def test_the_loss_is_the_mean_negative_log_probability() -> None:
    net = network()
    with torch.no_grad():
        for p in net.parameters():
            p.zero_()

    loss, accuracy = evaluate(net, data())

    assert loss == pytest.approx(np.log(2))
    assert accuracy == pytest.approx((data().y == 0).mean())


def test_augmentation_leaves_padding_zero() -> None:
    values = torch.ones(2, 3, 2)
    mask = torch.tensor([[True, True, False], [True, True, True]])
    values[0, 2] = 0
    changed = Augment(noise=1.0, gain=0.5, channel_gain=0.5, offset=1.0).apply(
        values, mask, torch.ones(2), 3, torch.Generator().manual_seed(0)
    )

    assert (changed[0, 2] == 0).all()
    assert not torch.equal(changed[1], values[1])


def test_no_augmentation_changes_nothing() -> None:
    values = torch.rand(2, 3, 2)

    mask = torch.ones(2, 3, dtype=torch.bool)

    assert Augment().apply(values, mask, torch.ones(2), 3, torch.Generator()) is values


def test_a_stretch_keeps_a_straight_line_straight() -> None:
    """Time-warp of a ramp is a ramp, at most 20 % steeper or flatter."""
    ramp = torch.arange(30.0)[None, :, None].repeat(50, 1, 1)
    mask = torch.ones(50, 30, dtype=torch.bool)

    out = Augment(warp=0.2).apply(ramp, mask, torch.ones(1), 24, torch.Generator().manual_seed(0))

    steps = out.diff(dim=1)
    assert out.shape == (50, 24, 1)
    assert torch.allclose(steps, steps[:, :1], atol=1e-4)
    assert 1 / 1.2 - 1e-3 <= float(steps.min()) < 0.95
    assert 1.05 < float(steps.max()) <= 1.2 + 1e-3
