"""Images to pixels and back: JPEG, depth as PNG of 16 bits; still PNG, BMP and TIFF are read.

The one place where images are coded.

Knows nothing about cameras, files or models.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput, BadSource, MissingExtra
from taxel.image_head import read_png16
from taxel.jpeg_head import check_size, read_head
from taxel.plain_text import number_of
from taxel.raster_head import as_stored, is_raster, raster_size
from taxel.signals import CameraInfo

try:
    import cv2
except ModuleNotFoundError as error:  # the array path needs no images
    raise MissingExtra("opencv-python-headless", "camera", "tactile cameras") from error

JPEG_QUALITY = 90
"""Of frames that taxel itself encodes, 0…100. Source: our choice, docs/decisions/0012."""

_PNG_EFFORT = 1
"""Of zlib, 0…9: the quickest. Source: our choice, docs/decisions/0052."""
_FAR_M = 2.0
"""What is shown as farthest, metres: a table with a robot on it. Our choice,
docs/decisions/0052."""
_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_PNG_SIDES = (16, 20)
"""Where width and height stand, four bytes each. Source: PNG specification, IHDR."""


def encode_jpeg(rgb: NDArray[np.uint8], quality: int = JPEG_QUALITY) -> bytes:
    """Return an image as JPEG.

    Args:
        rgb: Shape (height, width, 3), red first.
        quality: 0…100.

    Raises:
        BadInput: It is no such image of uint8.
        ValueError: The coder refused it, as one too large for the format.
    """
    return _encoded(rgb, "JPEG", ".jpg", [cv2.IMWRITE_JPEG_QUALITY, quality])


def decode_jpeg(jpeg: bytes, camera: CameraInfo | None) -> NDArray[np.uint8]:
    """Return a JPEG's pixels, shape (height, width, 3), red first.

    What it declares is checked first (`taxel.jpeg_head`): nothing that the camera cannot have
    sent reaches the decoder, whatever it would cost to decode.

    Args:
        jpeg: The image.
        camera: Whose it is: its size is the only one taken. None takes any size up to
            `taxel.jpeg_head.LARGEST_PX`, for images that belong to no camera.

    Raises:
        BadSource: It is no JPEG, is cut short, or not such as the camera sends.
    """
    read_head(jpeg, None if camera is None else (camera.width, camera.height))
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), flags)
    if bgr is None:
        raise _damaged(jpeg)
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def decode_frame(image: bytes, camera: CameraInfo) -> NDArray[np.uint8]:
    """Return a frame's pixels, shape (height, width, 3), red first: a JPEG's, or a PNG's as of
    trials that are replayed from files.

    Raises:
        BadSource: It is neither, damaged, or not of the camera's size.
    """
    if not image.startswith(_PNG):
        return decode_jpeg(image, camera)
    size = still_size(image)
    if size != (camera.width, camera.height):
        raise BadSource(
            f"frames of {camera.width}×{camera.height} from {camera.name}",
            f"{size[0]}×{size[1]}", "set the camera's size",
        )  # fmt: skip
    return decode_still(image)


def scaled_down(rgb: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return an image with so many pixels: as it is where it has them already.

    Args:
        rgb: Shape (height, width, 3).
        size: Width and height, not larger than the image's.
    """
    if (rgb.shape[1], rgb.shape[0]) == size:
        return rgb
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def encode_png(rgb: NDArray[np.uint8]) -> bytes:
    """Return an image as PNG, lossless.

    Args:
        rgb: Shape (height, width, 3), red first.

    Raises:
        BadInput: It is no such image of uint8.
        ValueError: The coder refused it, as one too large for the format.
    """
    return _encoded(rgb, "PNG", ".png", [cv2.IMWRITE_PNG_COMPRESSION, _PNG_EFFORT])


def decode_grey_quarter(jpeg: bytes, camera: CameraInfo | None) -> NDArray[np.uint8]:
    """Return a JPEG's brightness at a quarter of its size, shape (height / 4, width / 4).

    Args:
        jpeg: The image.
        camera: As for `decode_jpeg`.

    Raises:
        BadSource: As for `decode_jpeg`.
    """
    read_head(jpeg, None if camera is None else (camera.width, camera.height))
    flags = cv2.IMREAD_REDUCED_GRAYSCALE_4 | cv2.IMREAD_IGNORE_ORIENTATION
    grey = cv2.imdecode(np.frombuffer(jpeg, np.uint8), flags)
    if grey is None:
        raise _damaged(jpeg)
    return np.asarray(grey, dtype=np.uint8)


def encode_depth(depth: NDArray[np.uint16]) -> bytes:
    """Return a depth image as PNG of 16 bits, lossless.

    Args:
        depth: Shape (height, width), in the camera's depth unit; 0 where nothing was measured.

    Raises:
        BadInput: It is no such image of uint16: in another format depth would be cut to 8 bits.
        ValueError: The coder refused it.
    """
    if depth.ndim != 2 or depth.dtype != np.uint16 or not depth.size:
        raise BadInput("a depth image of shape (height, width), uint16", _seen(depth),
                       "round it to the camera's depth unit")  # fmt: skip
    done, coded = cv2.imencode(".png", depth, [cv2.IMWRITE_PNG_COMPRESSION, _PNG_EFFORT])
    if not done:
        raise ValueError(f"needed a depth image; got shape {depth.shape}")
    return coded.tobytes()


def decode_depth(png: bytes, camera: CameraInfo) -> NDArray[np.uint16]:
    """Return a depth image, shape (height, width), in the camera's depth unit; 0: not measured.

    Raises:
        BadSource: It is no PNG of 16 bits and of the camera's size, or it is damaged.
    """
    read_png16(png, (camera.width, camera.height))
    depth = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    if depth is None or depth.dtype != np.uint16:
        raise BadSource("a whole depth image", "a damaged one", "check the camera's cable")
    return np.asarray(depth, dtype=np.uint16)


def depth_picture(png: bytes, camera: CameraInfo) -> bytes:
    """Return a depth image as a JPEG in colours, for people: near red, far blue, unknown black.

    Raises:
        BadSource: As for `decode_depth`.
    """
    depth = decode_depth(png, camera)
    steps = _FAR_M / float(camera.details.get("depth_unit_m", "0.001"))
    near = np.clip(255.0 * (1.0 - depth / max(steps, 1.0)), 0.0, 255.0).astype(np.uint8)
    bgr = cv2.applyColorMap(near, cv2.COLORMAP_TURBO)
    bgr[depth == 0] = 0
    return encode_jpeg(np.asarray(bgr[..., ::-1], dtype=np.uint8).copy())


def still_size(image: bytes) -> tuple[int, int]:
    """Return the width and height that an image declares, pixels, without decoding it.

    Args:
        image: A PNG, JPEG, BMP or TIFF.

    Raises:
        BadSource: It is none of these, is empty, holds several, or is larger than
            `taxel.jpeg_head.LARGEST_PX`.
    """
    if is_raster(image):
        return raster_size(image)
    if not image.startswith(_PNG):
        if not image.startswith(_JPEG):
            raise BadSource("images that can be read", f"{number_of(len(image), 'byte')} of none",
                            "copy it again")  # fmt: skip
        head = read_head(image, own_file=True)
        return head.width, head.height
    width, height = (int.from_bytes(image[at : at + 4], "big") for at in _PNG_SIDES)
    check_size(width, height)
    return width, height


def decode_still(image: bytes) -> NDArray[np.uint8]:
    """Return the pixels of a PNG, JPEG, BMP or TIFF, shape (height, width, 3), red first.

    They are as the file stores them, however its tags (EXIF, TIFF) ask to turn them.

    Raises:
        BadSource: As `still_size` raises, or it is damaged.
    """
    still_size(image)
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    bgr = cv2.imdecode(np.frombuffer(as_stored(image), np.uint8), flags)
    if bgr is None:
        raise BadSource("images that can be read", "a damaged one", "copy it again")
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _encoded(rgb: NDArray[np.uint8], kind: str, ending: str, options: Sequence[int]) -> bytes:
    """Return an image of colours coded as a kind of file.

    Raises:
        BadInput: It is no such image of uint8.
        ValueError: The coder refused it.
    """
    _check_colour(rgb)
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    done, coded = cv2.imencode(ending, bgr, options)
    if not done:
        raise ValueError(f"needed an image that {kind} can hold; got shape {rgb.shape}")
    return coded.tobytes()


def _check_colour(rgb: NDArray[Any]) -> None:
    """Refuse what the encoders would take for another picture, such as colours of 0…1."""
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or not rgb.size:
        raise BadInput("an image of shape (height, width, 3), uint8, red first", _seen(rgb),
                       "bring it to 0…255 and three colours")  # fmt: skip


def _seen(image: NDArray[Any]) -> str:
    return f"shape {image.shape}, {image.dtype}"


def _damaged(jpeg: bytes) -> BadSource:
    return BadSource(
        "a whole JPEG image",
        f"{number_of(len(jpeg), 'byte')} without one",
        "check the camera's cable",
    )
