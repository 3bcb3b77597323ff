"""What ONNX Runtime refuses while a model runs is refused in taxel's own words."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper

from taxel.bundles.engine import open_engine
from taxel.errors import BadBundle
from taxel.models.onnx_session import WindowModel

VALUES, MASK = np.zeros((1, 2, 3), np.float32), np.ones((1, 2), bool)


def model_of(rows: int | str, kind: int) -> bytes:
    """Return a model of windows that casts them: so many at once, to such an element type."""
    graph = helper.make_graph(
        [helper.make_node("Cast", ["values"], ["found"], to=kind)], "cast",
        [helper.make_tensor_value_info("values", TensorProto.FLOAT, [rows, 2, 3])],
        [helper.make_tensor_value_info("found", kind, [rows, 2, 3])],
    )  # fmt: skip
    opset = helper.make_opsetid("", 18)
    content: bytes = helper.make_model(graph, opset_imports=[opset], ir_version=8)\
        .SerializeToString()  # fmt: skip
    return content


@pytest.mark.parametrize(
    ("rows", "kind", "got"),
    [
        (16, TensorProto.FLOAT, "one that ONNX Runtime refuses for them"),
        ("n", TensorProto.STRING, "one that gives object"),
        ("n", TensorProto.INT64, "one that gives int64"),
    ],
)
def test_a_model_that_cannot_be_run_on_a_window_is_one_plain_line(
    rows: int | str, kind: int, got: str
) -> None:
    model = model_of(rows, kind)
    for run in (lambda: WindowModel(model)(VALUES, MASK),
                lambda: open_engine(model).run(values=VALUES)):  # fmt: skip
        with pytest.raises(BadBundle, match=got) as refused:
            run()
        assert "\n" not in str(refused.value)


def test_a_model_that_can_is_run() -> None:
    model = model_of("n", TensorProto.FLOAT)
    np.testing.assert_array_equal(WindowModel(model)(VALUES, MASK), VALUES)


def test_no_usage_statistics_are_kept_or_sent(tmp_path: Path) -> None:
    """ONNX Runtime 1.32 does both as soon as it is imported, but in continuous integration."""
    others = {"CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY", "XDG_CACHE_HOME"}
    usual = {key: value for key, value in os.environ.items() if key not in others}
    code = "import os, taxel, onnxruntime; print(os.environ['ORT_DISABLE_TELEMETRY'])"
    printed = subprocess.check_output(
        [sys.executable, "-c", code], text=True, env=usual | {"HOME": str(tmp_path)}
    )

    assert printed == "1\n"
    assert not list(tmp_path.rglob("*deviceid*"))
