"""A step's time, and the share of the machine's limit that stands beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.bench.transitions.table_steps import step_rows, table_steps
from taxel.evaluation.cards.claims import STEP, STEP_SHARE, grasp_row
from taxel.evaluation.transitions import limits
from taxel.evaluation.transitions.limits import ProductLimit
from taxel.evaluation.transitions.step_times import StepTime, time_step
from taxel.models.transition import TRANSITION_MODELS, find_transition
from taxel.training.frames.extractors import open_backbone


def timed(stream_ms: float, limit_gflops: float | None = 100.0) -> StepTime:
    return StepTime(
        model="resnet50+lstm", frames=8, engine="onnxruntime f32", threads=2,
        stream_ms=stream_ms, window_ms=8 * stream_ms, limit_gflops=limit_gflops,
    )  # fmt: skip


def test_the_share_is_two_images_operations_over_what_the_limit_does_in_that_time() -> None:
    """ResNet50 has 7.716 GFLOP an image: two in 200 ms are 77.2 GFLOP/s, 0.772 of 100."""
    assert timed(200.0).share == pytest.approx(0.7715946496)
    assert timed(200.0, None).share is None


def test_the_limit_is_the_operations_of_a_product_over_its_quickest_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """2 · side³ operations in 0.5 s, the quickest of three."""
    monkeypatch.setattr(limits, "SIDE", 64)
    limit = ProductLimit("onnxruntime", "f32", 1)
    ticks = iter([0.0, 0.7, 1.0, 1.5, 2.0, 2.9])
    monkeypatch.setattr(limits, "perf_counter", lambda: next(ticks))

    assert limit.gflops() == pytest.approx(2 * 64**3 / 0.5 / 1e9)


def test_the_product_is_a_product(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is timed multiplies two matrices of 32-bit floats, and nothing else."""
    monkeypatch.setattr(limits, "SIDE", 64)
    limit = ProductLimit("onnxruntime", "f32", 1)
    weights = np.random.default_rng(1).normal(size=(64, 64)).astype(np.float32)

    found = limit._engine.run(values=limit._values)

    assert found == pytest.approx(limit._values @ weights, abs=1e-4)


def test_a_step_is_timed_beside_its_limit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The small backbone, on this machine: a stream is cheaper, and no step beats the limit."""
    monkeypatch.setattr(limits, "SIDE", 512)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    step = time_step("edge+lstm", repeats=3)

    assert step.stream_ms < step.window_ms
    assert step.share is not None
    assert 0 < step.share < 1


def test_a_step_compares_places_with_the_grasp_at_rest(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A head sees one row of features a camera, whether or not a backbone gives places apart."""
    monkeypatch.setattr(limits, "SIDE", 256)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    whole, apart = (open_backbone("mobilenet-v2", places=places) for places in (False, True))
    steps = [
        time_step("efficientnet-lite0+lstm", 2, repeats=3, extractor=extractor)
        for extractor in (whole, apart)
    ]
    assert [step.stream_ms > 0 for step in steps] == [True, True]
    frame = np.zeros((1, 240, 320, 3), np.uint8)
    assert apart.of(list(frame)).shape == (1, 49, 1000)
    np.testing.assert_allclose(apart.of(list(frame)).mean(axis=1), whole.of(list(frame)), atol=1e-3)


def test_rows_hold_the_quietest_step_over_the_quietest_product() -> None:
    """Of 220, 200 and 210 ms the second counts; of 120, 110 and 100 GFLOP/s the first."""
    model = find_transition("resnet50+lstm")
    rounds = [timed(220.0, 120.0), timed(200.0, 110.0), timed(210.0, 100.0)]
    time, share = step_rows(model, "onnxruntime f32", rounds)

    assert (time.name, time.value, time.ok) == (grasp_row(model.name, 8, STEP), 200.0, False)
    assert time.goal == "<= 25.81"
    assert share.name == grasp_row(model.name, 8, STEP_SHARE)
    assert share.value == timed(200.0, 120.0).share
    assert "25,701,009 numbers" in time.note


def test_another_engine_has_rows_of_its_own_and_8_bits_have_no_share() -> None:
    rows = step_rows(find_transition("resnet50+lstm"), "openvino int8", [timed(20.0, None)])

    assert [row.name for row in rows] == [
        grasp_row("resnet50+lstm", 8, f"{STEP}, openvino int8")
    ]  # fmt: skip
    assert rows[0].ok is True


def test_each_published_model_is_timed_once() -> None:
    """One measurement a backbone, the paper's ten models in all."""
    measures = table_steps()
    models = [model.name for _, measure in measures for model in measure.args[1]]  # type: ignore[attr-defined]

    assert len(measures) == 4
    assert sorted(models) == sorted(m.name for m in TRANSITION_MODELS.values() if m.published)


def test_on_a_graphics_card_its_steps_are_measurements_of_their_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So that those of a processor, measured on another machine, stay what they are."""
    monkeypatch.setattr("taxel.models.torch_engine.best_device", lambda: torch.device("cuda"))
    ways = {name: measure.args[2] for name, measure in table_steps()}  # type: ignore[attr-defined]

    assert len(ways) == 8
    for name, chosen in ways.items():
        assert {engine == "torch" for engine, _ in chosen} == {"on a graphics card" in name}
