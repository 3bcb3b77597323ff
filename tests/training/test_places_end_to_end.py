"""Training end to end compares each place of an image with the grasp at rest, as features do."""

from importlib.util import find_spec

import numpy as np
import pytest
import torch

from taxel.training.frames.heads import HeadConfig, Track, fit_head
from taxel.windows.rest import compared
from taxel.windows.sequence import sequence_windows

if find_spec("lightning_fabric") is None:
    pytest.skip(
        "lightning-fabric is not installed: pip install 'taxel[fine-tune]'", allow_module_level=True
    )

from taxel.training.backbones.fine_tuning import EndToEnd

K = 3


class _Quarters(torch.nn.Module):
    """Features of four places: the mean of each colour there."""

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        """Return features, shape (n, 4, 3), of images (n, 3, h, w)."""
        places = torch.nn.functional.adaptive_avg_pool2d(images, 2)
        return places.flatten(2).transpose(1, 2)


def test_end_to_end_compares_places_as_cached_features_are() -> None:
    chance = np.random.default_rng(0)
    recordings = [Track(chance.random((40, 3)).astype(np.float32),
                        np.arange(40, dtype=np.intp).reshape(20, 2),
                        (np.arange(20) > 9).astype(np.int8))]  # fmt: skip
    head = fit_head(recordings, HeadConfig(frames=K, epochs=1, tare="local-size"))
    images = torch.from_numpy(chance.integers(0, 256, (10, 24, 32, 3), np.uint8))
    frames, rest = torch.arange(8).reshape(1, 4, 2), torch.tensor([[[8, 9], [0, 1], [8, 9]]])
    module = EndToEnd(_Quarters(), "edge", [head]).eval()
    with torch.inference_mode():
        found = module(images, frames, rest)[0][0, 0].sigmoid().numpy()
        places = module.features(images).numpy()
    still = np.median(places[rest[0].numpy()], axis=0)
    scaled = (compared(places[frames[0].numpy()], still) - head.offset) * head.factor
    windows = torch.from_numpy(sequence_windows(scaled.astype(np.float32), K).copy())
    with torch.inference_mode():
        wanted = head.module(windows.flatten(2)).sigmoid().numpy()
    np.testing.assert_allclose(found, wanted, atol=1e-5)
