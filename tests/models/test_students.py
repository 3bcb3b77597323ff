"""A student's start: the best that is at hand, and words that say which."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from taxel.errors import BadInput
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.backbones.random_start import fill_randomly
from taxel.models.backbones.weight_files import save_backbone_weights
from taxel.models.published.about import About
from taxel.models.published.origins import ORIGINS, STARTS, find_origins, network_of
from taxel.models.students import FAR, NEAR, begin_student, check_student
from taxel.models.weights import RANDOM, fetched_weights, find_weights

TYPEFACES = "densenet121-typefaces"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder of fetched weights, empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("TAXEL_WEIGHTS", raising=False)
    folder = tmp_path / "taxel" / "weights"
    folder.mkdir(parents=True)
    return folder


def _save(path: Path, backbone: str, about: About | None = None) -> torch.nn.Module:
    module = find_backbone(backbone).build("logits")
    fill_randomly(module, backbone, seed=8)
    save_backbone_weights(module, path, about.head() if about else None)
    return module


@pytest.mark.slow
def test_without_anything_at_hand_a_student_is_random_and_says_so(cache: Path) -> None:
    student = begin_student("resnet101", None, seed=2)

    assert (student.start, student.learning_rate) == ("random numbers", FAR)
    other = find_backbone("resnet101").build("logits")
    fill_randomly(other, "resnet101", seed=2)
    own = student.module.state_dict()
    assert all(torch.equal(own[key], value) for key, value in other.state_dict().items())


@pytest.mark.slow
def test_a_relatives_file_is_grown_and_named(cache: Path) -> None:
    relative = _save(cache / "resnet50.safetensors", "resnet50").eval()

    student = begin_student("resnet101", None, seed=2)

    assert student.start == "resnet50's file:resnet50.safetensors"
    assert student.learning_rate == NEAR
    images = torch.rand(1, 3, 64, 64, generator=torch.Generator().manual_seed(1)) * 255
    with torch.no_grad():
        wanted, found = relative(images), student.module.eval()(images)
    assert (found - wanted).abs().max() <= 1e-4 * wanted.abs().max()


@pytest.mark.slow
def test_weights_of_typefaces_are_a_start_and_never_called_imagenet(cache: Path) -> None:
    (origin,) = STARTS[TYPEFACES]
    module = _save(cache / f"{TYPEFACES}.safetensors", "densenet121", About(origin=origin.words))

    student = begin_student("densenet121", None, seed=2)

    assert student.start.startswith(f"{TYPEFACES} (")
    assert student.learning_rate == FAR
    own = student.module.state_dict()
    assert all(torch.equal(own[key], value) for key, value in module.state_dict().items())
    found = fetched_weights(TYPEFACES)
    assert found is not None
    assert found.label == f"file:{TYPEFACES}.safetensors"
    assert find_weights("densenet121").label == RANDOM


@pytest.mark.slow
def test_a_named_file_goes_before_all(cache: Path, tmp_path: Path) -> None:
    _save(cache / "resnet50.safetensors", "resnet50")
    _save(tmp_path / "own.safetensors", "resnet101", About(origin="a lab", trained="on gels"))

    student = begin_student("resnet101", tmp_path / "own.safetensors", seed=2)

    assert student.start == "file:own.safetensors (a lab, on gels)"


def test_starts_have_names_and_places_of_their_own() -> None:
    assert not set(STARTS) & set(ORIGINS)
    for name, places in STARTS.items():
        find_backbone(network_of(name))
        assert find_origins(name) == places
        assert not any(place.imagenet for place in places)


@pytest.mark.parametrize(
    ("pair", "side_px"),
    [(("edge", "resnet50"), 96), (("resnet50", "resnet50"), 96), (("resnet101", "resnet50"), 8)],
)
def test_a_pair_that_cannot_be_is_refused(pair: tuple[str, str], side_px: int) -> None:
    with pytest.raises(BadInput):
        check_student(*pair, side_px)
