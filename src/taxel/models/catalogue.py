"""All models by name, in one visible dict.

To add a network: write its module, add one line to `MODELS`, and the tests in
`tests/contracts/test_every_model.py` cover it. Knows nothing about training or
files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from torch import nn

from taxel.errors import BadInput
from taxel.models.cnn1d import Cnn1d
from taxel.models.cnn2d import Cnn2d
from taxel.models.cnn3d import Cnn3d
from taxel.models.conv_lstm import ConvLstm
from taxel.models.forest import CourseForest
from taxel.models.inception_time import InceptionTime
from taxel.models.library import Estimator, ExtraTrees, MiniRocketRidge
from taxel.models.lstm import Lstm
from taxel.models.touchnet import TouchNet
from taxel.models.with_statistics import WithStatistics
from taxel.windows.scaling import ScalingKind


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """A model that the training loop trains and a bundle carries."""

    summary: str
    """What it is, one line."""
    source: str
    """Where it comes from."""
    build: Callable[[int, int, int], nn.Module]
    """(steps, channels, classes) → module; forward(values, mask) → logits."""
    scaling: ScalingKind
    """The scaling that it expects unless another is asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """A library's model, to compare with."""

    summary: str
    """What it is, one line."""
    source: str
    """Where it comes from."""
    build: Callable[[int], Estimator]
    """seed → estimator."""
    scaling: ScalingKind = "none"
    """The scaling that it expects."""


MODELS: dict[str, Network | Baseline] = {
    "cnn1d": Network(
        summary="1D CNN over the flat sequence of all values (signal-based)",
        source="TENG thesis, section 3.5; sizes: docs/decisions/0007",
        build=Cnn1d,
        scaling="full-scale",
    ),
    "cnn2d": Network(
        summary="2D CNN over the image of steps × channels (image-based)",
        source="TENG thesis, section 3.6; sizes: docs/decisions/0007",
        build=Cnn2d,
        scaling="full-scale",
    ),
    "touchnet": Network(
        summary="residual 1D CNN over four views of each channel, for any array",
        source="ours, docs/decisions/0011",
        build=TouchNet,
        scaling="none",
    ),
    "lstm": Network(
        summary="one LSTM over the rows of a window",
        source="TENG thesis, section 2.5.3; sizes: docs/decisions/0024",
        build=Lstm,
        scaling="full-scale",
    ),
    "cnn3d": Network(
        summary="3D CNN over time × fingers × phalanges",
        source="TENG thesis, section 2.5.3; sizes: docs/decisions/0024",
        build=Cnn3d,
        scaling="full-scale",
    ),
    "conv-lstm": Network(
        summary="ConvLSTM: an LSTM with convolutions over fingers × phalanges",
        source="TENG thesis, section 1; Shi et al., NeurIPS 2015; sizes: docs/decisions/0047",
        build=ConvLstm,
        scaling="full-scale",
    ),
    "inception-time": Network(
        summary="InceptionTime: convolutions of several lengths, six modules deep",
        source="Ismail Fawaz et al., Data Mining and Knowledge Discovery 2020; ours in PyTorch",
        build=InceptionTime,
        scaling="standard",
    ),
    "course-forest": Network(
        summary="extremely randomised trees on each channel's course, for short sequences",
        source="Geurts et al., Machine Learning 2006; docs/decisions/0011",
        build=CourseForest,
        scaling="none",
    ),
    "minirocket": Baseline(
        summary="MiniRocket features and a ridge classifier",
        source="Dempster et al., KDD 2021; aeon",
        build=MiniRocketRidge,
    ),
    "extra-trees": Baseline(
        summary="extremely randomised trees over each channel's statistics",
        source="Geurts et al., Machine Learning 2006; scikit-learn",
        build=ExtraTrees,
    ),
}
"""Name → model."""


WITH_STATISTICS = "+statistics"
"""Behind a network's name: the network with each channel's statistics beside its features."""


def find_model(name: str) -> Network | Baseline:
    """Return a model by name; "NAME+statistics" is a network with statistics beside its features.

    Raises:
        BadInput: There is no model of this name.
    """
    body = MODELS.get(name.removesuffix(WITH_STATISTICS))
    if name.endswith(WITH_STATISTICS) and isinstance(body, Network) and body.build != CourseForest:
        return _with_statistics(body)
    if name not in MODELS:
        raise BadInput(
            f"one of the models {', '.join(MODELS)}", repr(name), "see them with: taxel models"
        )
    return MODELS[name]


def _with_statistics(body: Network) -> Network:
    return Network(
        summary=f"{body.summary}, with each channel's statistics",
        source=f"{body.source}; docs/decisions/0028",
        build=lambda steps, channels, classes: WithStatistics(
            body.build(steps, channels, classes), channels, classes
        ),
        scaling=body.scaling,
    )


def find_network(name: str) -> Network:
    """Return a network by name.

    Raises:
        BadInput: There is no model of this name, or it is a baseline.
    """
    model = find_model(name)
    if isinstance(model, Network):
        return model
    networks = [key for key, value in MODELS.items() if isinstance(value, Network)]
    raise BadInput(
        f"one of the networks {', '.join(networks)}",
        f"{name!r}, a baseline to compare with",
        "name a network",
    )


def count_parameters(module: nn.Module) -> int:
    """Return how many trainable numbers a network has."""
    return sum(p.numel() for p in module.parameters() if p.requires_grad)
