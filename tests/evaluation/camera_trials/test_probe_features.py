"""Features for a probe are kept by all that decides which images they are of."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.camera_trials.probe_features import crop_features
from taxel.training.encoder.videos import chosen_frames
from taxel.windows.camera_trials import CameraTrial

Image = NDArray[np.uint8]


class Numbered:
    """A video each of whose images holds its number."""

    def __call__(self, camera: int) -> Iterator[Image]:
        return (np.full((4, 4, 3), number, np.uint8) for number in range(240))

    def digest(self) -> str:
        return "d" * 64


@dataclass(frozen=True)
class Brightness:
    """Each image's first value."""

    key: str = "brightness"
    features: int = 1
    in_order: bool = False
    places: bool = False

    def of(self, images: Sequence[Image]) -> NDArray[np.float32]:
        return np.array([[image[0, 0, 0]] for image in images], np.float32)


TRIAL = CameraTrial(
    name="t", labels={}, groups={}, cameras=("left",), frames=240, width=4, height=4, rate_hz=25.0,
    mm_per_px=None, digest="d" * 64, turned="d" * 64, recorded=False, read=Numbered(),
)  # fmt: skip


def test_a_rate_that_was_corrected_gives_other_images(tmp_path: Path) -> None:
    for trial in (TRIAL, replace(TRIAL, rate_hz=50.0), TRIAL):
        (found,) = crop_features([trial], [Brightness()], tmp_path)
        wanted = chosen_frames(trial.frames, trial.rate_hz)
        np.testing.assert_array_equal(found[0, 0, :, :, 0], wanted)
