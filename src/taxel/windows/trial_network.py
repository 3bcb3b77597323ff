"""How a crop looks to an image network that was trained on pictures of anything.

Eight of its images pass through; a crop has the mean of what the network gives for them, so that
it does not matter when in the crop something is seen. The network is handed in: its weights come
with what trains, and with a bundle. Knows nothing about labels, models behind it or files.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Network = Callable[[Image], NDArray[np.float32]]
"""Images, shape (n, 224, 224, 3), red first, 0…255 → shape (n, `FEATURES`)."""
SIDE_PX: Final = 224
"""Height and width of the images that a network is given, pixels, whatever a camera's shape.
Source: EfficientNet-Lite0's."""
FEATURES: Final = 3120
"""Numbers that a network gives for an image: of 112, 192 and 320 channels the means of the image's
quarters and the deviation. Source: our choice, docs/decisions/0041."""
IMAGES: Final = 8
"""Of a crop, evenly apart. Source: our choice, docs/decisions/0041."""
VERSION: Final = "network-2"
"""For caches and bundles."""


def look_through_network(images: Sequence[Image], network: Network | None) -> NDArray[np.float32]:
    """Return the mean of what a network gives for eight images of a crop, shape (1, 3120).

    Args:
        images: All of the crop, shape (height, width, 3) each, red first.
        network: What looks at them.

    Raises:
        ValueError: There is no network.
    """
    if network is None:
        raise ValueError("a view through an image network needs the network")
    chosen = [images[at] for at in (np.arange(IMAGES) * len(images) // IMAGES).tolist()]
    different = {id(image): image for image in chosen}  # one that stands still is looked at once
    found = network(np.stack([_square(image) for image in different.values()]))
    place = {key: at for at, key in enumerate(different)}
    return np.asarray(found[[place[id(image)] for image in chosen]].mean(axis=0)[None], np.float32)


def as_it_is(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what was seen, shape (cameras, columns).

    Args:
        values: Shape (1, cameras, columns).
    """
    return np.asarray(values[0], np.float32)


def _square(image: Image) -> Image:
    """Return an image of the network's size; shrunk by areas, so that no fine texture aliases.

    A shorter side is stretched afterwards: beside a side that grows OpenCV shrinks none by areas.
    """
    height, width = (min(side, SIDE_PX) for side in image.shape[:2])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    size = SIDE_PX, SIDE_PX
    return np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_LINEAR), np.uint8)
