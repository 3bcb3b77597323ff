"""The grasp-transition networks: the paper's counts, heads against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from taxel.errors import BadInput
from taxel.models.sequence import HEADS, LstmHead, SelfAttention, sinusoids
from taxel.models.transition import (
    PUBLISHED_BY_FRAMES,
    TRANSITION_MODELS,
    split_name,
)

PAPER = {
    "densenet121+lstm": 8_126_801,
    "efficientnet-b0+lstm": 5_394_868,
    "resnet50+lstm": 25_701_009,
    "resnet101+lstm": 44_771_473,
    "densenet121+transformer": 9_242_921,
    "efficientnet-b0+transformer": 6_510_988,
    "resnet50+transformer": 26_817_129,
    "resnet101+transformer": 45_887_593,
    "densenet121+lstm2": 8_127_345,
    "densenet121+lstm4": 8_128_433,
}
"""Parameters, Tables 1 and 2."""


@pytest.mark.parametrize("name", PAPER)
def test_parameters_equal_the_papers_tables_exactly(name: str) -> None:
    model = TRANSITION_MODELS[name]

    assert model.parameters == PAPER[name]
    assert model.published is not None
    assert model.published.parameters == PAPER[name]
    assert model.name == name


def test_ours_stand_beside_the_papers_and_claim_no_published_figure() -> None:
    ours = [name for name, model in TRANSITION_MODELS.items() if model.published is None]

    assert ours == ["efficientnet-lite0+lstm", "edge+lstm"]
    assert len(TRANSITION_MODELS) == 12


def test_the_best_window_of_table_3_is_table_1s_row() -> None:
    published = TRANSITION_MODELS["densenet121+lstm"].published

    assert published is not None
    assert PUBLISHED_BY_FRAMES[8] == published.accuracy_percent
    assert sorted(PUBLISHED_BY_FRAMES) == list(range(2, 12))


def _keras_lstm(head: LstmHead, window: np.ndarray) -> float:
    """The paper's equations 1 to 6 in numpy; gates in Keras' order: i, f, c, o."""
    values = {name: tensor.detach().numpy() for name, tensor in head.named_parameters()}

    def squash(x: np.ndarray) -> np.ndarray:
        return 1 / (1 + np.exp(-x))

    sequence = window
    for layer in range(head.lstm.num_layers):
        hidden = cell = np.zeros(head.lstm.hidden_size)
        outputs = []
        for step in sequence:
            both = values[f"lstm.weight_ih_l{layer}"] @ step
            both = both + values[f"lstm.weight_hh_l{layer}"] @ hidden
            i, f, c, o = np.split(both + values[f"lstm.bias_ih_l{layer}"], 4)
            cell = squash(f) * cell + squash(i) * np.tanh(c)
            hidden = squash(o) * np.tanh(cell)
            outputs.append(hidden)
        sequence = np.array(outputs)
    return float((values["last.weight"] @ sequence[-1] + values["last.bias"])[0])


@pytest.mark.parametrize("layers", [1, 2, 4])
def test_the_lstm_head_follows_the_papers_equations(layers: int) -> None:
    torch.manual_seed(layers)
    head = LstmHead(features=5, layers=layers)
    windows = np.random.default_rng(0).normal(size=(3, 8, 10)).astype(np.float32)

    with torch.no_grad():
        found = head(torch.from_numpy(windows)).numpy()

    assert found == pytest.approx([_keras_lstm(head, w) for w in windows], abs=1e-5)


def test_the_second_lstm_bias_stays_zero_and_does_not_learn() -> None:
    torch.manual_seed(0)
    head = LstmHead(features=3, layers=2)
    head(torch.randn(4, 6, 6)).sum().backward()
    second = [tensor for name, tensor in head.named_parameters() if "bias_hh" in name]

    assert len(second) == 2
    assert all(not t.requires_grad and t.grad is None and not t.any() for t in second)


def test_positions_are_the_papers_sines_and_cosines() -> None:
    """Equations 9 and 10 at one even and one odd place."""
    positions = sinusoids(8, 2000)

    assert positions.shape == (8, 2000)
    assert positions[3, 10].item() == pytest.approx(np.sin(3 / 10000 ** (10 / 2000)), abs=1e-6)
    assert positions[3, 11].item() == pytest.approx(np.cos(3 / 10000 ** (10 / 2000)), abs=1e-6)


def test_attention_equals_pytorchs_own_over_the_same_heads() -> None:
    torch.manual_seed(0)
    attention = SelfAttention(width=20)
    steps = torch.randn(2, 8, 20)
    q, k, v = (
        layer(steps).reshape(2, 8, 4, 32).transpose(1, 2)
        for layer in (attention.query, attention.key, attention.value)
    )
    mixed = torch.nn.functional.scaled_dot_product_attention(q, k, v)

    torch.testing.assert_close(
        attention(steps), attention.output(mixed.transpose(1, 2).reshape(2, 8, 128))
    )


@pytest.mark.parametrize("name", HEADS)
@pytest.mark.parametrize("frames", [2, 11])
def test_every_head_takes_every_window_of_table_3_and_learns(name: str, frames: int) -> None:
    """One logit a window, the same for a window alone as in a batch, with gradients."""
    torch.manual_seed(0)
    head = HEADS[name].build(6, frames)
    windows = torch.randn(3, frames, 12)
    logits = head(windows)
    logits.sum().backward()

    assert logits.shape == (3,)
    torch.testing.assert_close(head(windows[1:2]), logits[1:2])
    assert all(p.grad is not None for p in head.parameters() if p.requires_grad)


@pytest.mark.parametrize("name", HEADS)
def test_the_order_of_frames_matters(name: str) -> None:
    torch.manual_seed(0)
    head = HEADS[name].build(6, 8)
    windows = torch.randn(3, 8, 12)

    assert not torch.allclose(head(windows), head(windows.flip(1)), atol=1e-4)


@pytest.mark.parametrize("name", ["densenet121", "vgg+lstm", "edge+gru"])
def test_an_unknown_name_is_refused_in_one_line(name: str) -> None:
    with pytest.raises(BadInput, match="see them with: taxel models"):
        split_name(name)


def test_published_sizes_hold_the_backbone_twice_and_the_head_once() -> None:
    """Twice the backbone leaves 0.4 to 1 MiB for a file's own words; nothing else fits.

    The Transformer's head has 1,116,120 numbers more than the LSTM's: 4.26 MiB once. Published
    sizes differ by 4.27 or 4.28, so that neither 64-bit floats nor an optimiser's state is in them.
    """
    rows = [model for model in TRANSITION_MODELS.values() if model.published]
    for model in rows:
        assert model.published is not None
        assert 0.4 < model.published.size_mb - model.size_mb(backbones=2) < 1.0, model.name
        assert model.published.size_mb - model.size_mb() > 20.0, model.name
    size = {model.name: model.published.size_mb for model in rows if model.published}
    for backbone in ("densenet121", "efficientnet-b0", "resnet50", "resnet101"):
        more = size[f"{backbone}+transformer"] - size[f"{backbone}+lstm"]
        assert more == pytest.approx(1_116_120 * 4 / 2**20, abs=0.03)
