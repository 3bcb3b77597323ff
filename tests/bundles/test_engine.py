"""Engines: few rows run side by side give the numbers that they give together and alone."""

from __future__ import annotations

import contextlib
import os
import threading
from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.bundles.engine import largest_difference, open_engine
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.export_onnx import export_backbone

SIZE_PX = (60, 80)


@pytest.fixture(scope="module")
def model() -> bytes:
    torch.manual_seed(0)
    name = "efficientnet-lite0"
    return export_backbone(find_backbone(name).build("logits").eval(), name, *SIZE_PX)


@pytest.mark.parametrize("rows", [1, 2, 3, 5])
def test_rows_side_by_side_give_what_each_gives_alone(model: bytes, rows: int):
    frames = np.random.default_rng(rows).integers(0, 256, (rows, *SIZE_PX, 3), np.uint8)
    engine = open_engine(model, threads=1)
    alone = np.concatenate([engine.run(frames=frames[i : i + 1]) for i in range(rows)])
    several = open_engine(model, threads=3)
    assert alone.shape == (rows, 1000)
    for _ in range(2):
        np.testing.assert_allclose(several.run(frames=frames), alone, rtol=0, atol=1e-5)
    if 1 < rows <= 3:
        np.testing.assert_array_equal(several.run(frames=frames), alone)


def test_openvino_is_not_bound_to_a_core_that_another_process_may_use(model: bytes):
    """By default it binds its thread to the first core while it runs, in each process."""
    pytest.importorskip("openvino")
    free = os.sched_getaffinity(0)
    engine = open_engine(model, "openvino")
    frames = np.zeros((4, *SIZE_PX, 3), np.uint8)
    done = threading.Event()

    def run() -> None:
        for _ in range(60):
            engine.run(frames=frames)
        done.set()

    seen: set[frozenset[int]] = set()
    worker = threading.Thread(target=run)
    worker.start()
    while not done.is_set():
        for task in Path("/proc/self/task").iterdir():
            with contextlib.suppress(OSError):  # it has just ended
                seen.add(frozenset(os.sched_getaffinity(int(task.name))))
    worker.join()
    assert seen == {frozenset(free)}


def test_numbers_that_are_none_are_no_difference_to_accept():
    """A signalling NaN, as damage can leave one, is reported by the processor; that is no error."""
    found = np.array([0.5, 0.25], np.float32)
    damaged = np.array([0x7FA00000, 0x3E800000], np.uint32).view(np.float32)

    assert np.isnan(largest_difference(found, damaged))
    assert largest_difference(found, np.array([0.5, 0.5], np.float32)) == 0.25
