"""Where a bundle runs: what is there may be chosen, what is not is refused by name."""

from pathlib import Path
from types import SimpleNamespace

import onnxruntime
import pytest

from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.cli.main import main
from taxel.errors import BadBundle, BadInput
from taxel.models.devices import PROVIDERS, check_device, devices_here
from taxel.models.onnx_session import open_session


def test_the_processor_is_always_there() -> None:
    assert "cpu" in devices_here()
    check_device("cpu")


@pytest.mark.parametrize("device", ["cuda", "gpu", ""])
def test_a_device_that_is_not_there_is_refused_naming_those_that_are(
    device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    built = [PROVIDERS["cpu"], "AzureExecutionProvider", PROVIDERS["openvino"]]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: built)

    with pytest.raises(BadInput, match="TAXEL_DEVICE among cpu, openvino, which are here; got"):
        check_device(device)


def opened_with(monkeypatch: pytest.MonkeyPatch, gives: list[str]) -> list[object]:
    """Let ONNX Runtime have CUDA, and open what `gives` says; return what it was asked for."""
    asked: list[object] = []

    def session(model: bytes, options: object, providers: list[object]) -> SimpleNamespace:
        asked.extend(providers)
        return SimpleNamespace(get_providers=lambda: gives)

    monkeypatch.setattr(onnxruntime, "InferenceSession", session)
    monkeypatch.setattr(
        onnxruntime, "get_available_providers", lambda: [PROVIDERS["cuda"], PROVIDERS["cpu"]]
    )
    return asked


def test_a_card_is_asked_for_whole_numbers_and_the_processor_runs_the_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = opened_with(monkeypatch, [PROVIDERS["cuda"], PROVIDERS["cpu"]])
    open_session(b"", 1, "cuda")

    assert asked == [("CUDAExecutionProvider", {"use_tf32": "0"}), "CPUExecutionProvider"]


def test_a_card_that_cannot_be_opened_is_refused_not_replaced(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened_with(monkeypatch, [PROVIDERS["cpu"]])

    with pytest.raises(BadBundle, match="a cuda device that ONNX Runtime can open"):
        open_session(b"", 1, "cuda")


@pytest.mark.parametrize(
    "words",
    [
        ["live", CUP_POUR, "sim://cup-pour", "--seconds", "1"],
        ["evaluate", "{bundle}", "."],
    ],
)
def test_the_command_line_refuses_it_in_one_line(
    words: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TAXEL_DEVICE", "tensorrt")
    bundle: Path = shipped_bundle(CUP_POUR)
    with pytest.raises(SystemExit) as ended:
        main([word.format(bundle=bundle) for word in words])

    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "needed TAXEL_DEVICE among cpu" in line
