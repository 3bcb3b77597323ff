"""Every model fulfils one contract: shapes, seeds, masks, and ONNX parity for networks."""

import numpy as np
import pytest
import torch

from taxel.bundles.writer import Classifier, export_onnx
from taxel.models import forest
from taxel.models.catalogue import MODELS, Baseline, Network, count_parameters
from taxel.training.loop import Labelled, TrainConfig, evaluate, fit, new_network, predict

NETWORKS = [name for name, model in MODELS.items() if isinstance(model, Network)]
BASELINES = [name for name, model in MODELS.items() if isinstance(model, Baseline)]
SHAPES = [(1, 5, 2), (12, 12, 3), (21, 69, 10), (400, 8, 10), (9, 1, 2)]


@pytest.fixture(autouse=True)
def _few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred trees are exported, learn and repeat themselves as a thousand do."""
    monkeypatch.setattr(forest, "TREES", 100)


def separable(n: int = 120, steps: int = 12, channels: int = 12) -> Labelled:
    """Two classes: the first or the last channel is high."""
    rng = np.random.default_rng(0)
    y = np.arange(n) % 2
    values = rng.normal(0.3, 0.1, (n, steps, channels)).astype(np.float32)
    values[y == 0, :, 0] += 0.6
    values[y == 1, :, -1] += 0.6
    return Labelled(values, np.ones((n, steps), bool), y.astype(np.intp))


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize(("steps", "channels", "classes"), SHAPES)
def test_a_network_takes_any_window_and_gives_logits(
    name: str, steps: int, channels: int, classes: int
) -> None:
    network = new_network(lambda: MODELS[name].build(steps, channels, classes), 0)
    values = torch.rand(5, steps, channels)

    logits = network.eval()(values, torch.ones(5, steps, dtype=torch.bool))

    assert logits.shape == (5, classes)
    assert torch.isfinite(logits).all()


@pytest.mark.parametrize("name", NETWORKS)
def test_a_seed_gives_the_same_network(name: str) -> None:
    first, again, other = (
        new_network(lambda: MODELS[name].build(12, 12, 3), seed) for seed in (1, 1, 2)
    )

    for a, b in zip(first.parameters(), again.parameters(), strict=True):
        assert torch.equal(a, b)
    weights = list(zip(first.parameters(), other.parameters(), strict=True))
    assert not weights or any(not torch.equal(a, b) for a, b in weights)


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_a_network_learns_what_can_be_seen(name: str) -> None:
    data = separable()
    network = new_network(lambda: MODELS[name].build(12, 12, 2), 0)

    fit(network, data, TrainConfig(epochs=25, batch=16))

    assert evaluate(network, data)[1] > 0.97


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize(("steps", "channels", "classes"), SHAPES[:4])
def test_the_exported_network_gives_what_pytorch_gives(
    name: str, steps: int, channels: int, classes: int
) -> None:
    import onnxruntime

    network = new_network(lambda: MODELS[name].build(steps, channels, classes), 0)
    rng = np.random.default_rng(1)
    known = rng.normal(0.0, 2.0, (20, steps, channels)).astype(np.float32)
    y = (np.arange(20) % classes).astype(np.intp)
    fit(network, Labelled(known, np.ones((20, steps), bool), y), TrainConfig(epochs=1))
    session = onnxruntime.InferenceSession(export_onnx(Classifier((network,)), steps, channels))
    rng = np.random.default_rng(0)
    values = rng.random((7, steps, channels), dtype=np.float32)
    mask = np.ones((7, steps), bool)
    mask[3:, steps // 2 :] = False
    values *= mask[:, :, None]
    feed = {"values": values, "mask": mask}
    names = {entry.name for entry in session.get_inputs()}

    found = session.run(None, {key: feed[key] for key in names})[0]

    np.testing.assert_allclose(found, predict(network, values, mask), atol=1e-5)


@pytest.mark.parametrize("name", BASELINES)
def test_a_baseline_learns_what_can_be_seen_and_repeats_itself(name: str) -> None:
    data = separable()
    found = []
    for _ in range(2):
        model = MODELS[name].build(0)
        model.fit(data.values, data.mask, data.y)
        found.append(model.predict_proba(data.values, data.mask))

    assert found[0].shape == (120, 2)
    np.testing.assert_allclose(found[0].sum(axis=1), 1.0)
    np.testing.assert_array_equal(found[0], found[1])
    assert (found[0].argmax(axis=1) == data.y).mean() > 0.97


def test_the_thesis_networks_have_the_documented_size() -> None:
    """docs/decisions/0007 and the microcontroller budget hang on these."""
    counts = {name: count_parameters(MODELS[name].build(12, 12, 3)) for name in ("cnn1d", "cnn2d")}

    assert counts == {"cnn1d": 19267, "cnn2d": 5987}
