"""Claims about the touch encoder that comes with taxel: its size, its weights, its card."""

import json
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from taxel.models import weights as weights_module
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.counting import keras_parameters
from taxel.models.frame_network import FrameNetwork
from taxel.models.weights import SHIPPED, VARIABLE, find_weights, shipped_weights
from taxel.windows.touch_view import MODEL, look_through_touch

READY = Path(weights_module.__file__).with_name("backbones") / "ready"
PAGE = Path(__file__).parents[2] / "docs/reference/touch-encoder.md"


def shipped() -> torch.nn.Module:
    module = find_backbone("touch").build("logits").eval()
    found = shipped_weights("touch")
    assert found is not None
    found.load_into(module)
    return module


def test_it_is_small_and_its_weights_come_with_taxel() -> None:
    """At most 1.5 million numbers; both files together at most 6 MB."""
    module = shipped()

    assert keras_parameters(module) <= 1_500_000
    assert (READY / "touch.safetensors").stat().st_size + MODEL.stat().st_size <= 6e6


def test_a_run_starts_from_them_unless_other_weights_are_named(tmp_path: Path) -> None:
    found = find_weights("touch", environment={})

    assert found.label == SHIPPED
    assert "train-encoder" in found.words
    assert find_weights("touch", found.path, environment={}).label == "file:touch.safetensors"
    with pytest.raises(Exception, match="no"):
        find_weights("touch", environment={VARIABLE: str(tmp_path / "none")})


def test_the_onnx_file_gives_what_the_weights_give() -> None:
    """Camera trials look through the same encoder as monitors."""
    frames = np.random.default_rng(0).integers(0, 256, (3, 120, 160, 3), np.uint8)
    with torch.no_grad():
        wanted = FrameNetwork(shipped(), "touch")(torch.from_numpy(frames)).numpy()
    session = onnxruntime.InferenceSession(MODEL.read_bytes(), providers=["CPUExecutionProvider"])
    found = session.run(None, {"frames": frames})[0]

    assert np.abs(found - wanted).max() <= 1e-4 * max(1.0, np.abs(wanted).max())


def test_a_crop_is_looked_at_in_eight_images_evenly_apart() -> None:
    """Of 48 frames those numbered 0, 6, … 42; what lies between them is not looked at."""
    random = np.random.default_rng(1)
    images = [random.integers(0, 256, (24, 32, 3), np.uint8) for _ in range(48)]
    found = look_through_touch(images)
    other = [image if at % 6 == 0 else np.zeros_like(image) for at, image in enumerate(images)]

    assert found.shape == (8, 192)
    assert np.array_equal(look_through_touch(other), found)


def test_the_card_and_the_page_list_all_that_it_saw() -> None:
    card, page = json.loads((READY / "touch.json").read_text()), PAGE.read_text()
    seen, begun = list(card["seen"]), card["began_from"]
    seen += begun["seen"] if begun else []

    assert seen
    for folder in seen:
        assert folder["folder"] in page
        assert folder["sha256"][:12] in page
        assert all(thing in page for thing in folder["groups"].get("object", ()))


def test_it_saw_no_real_image_so_that_its_probe_on_real_objects_is_on_unseen_ones() -> None:
    card = json.loads((READY / "touch.json").read_text())

    assert card["began_from"] is None
    assert all(folder["simulated"] for folder in card["seen"])
