"""How large an image of BMP or TIFF says it is, and how it is turned, before it is decoded.

Only images of one page and of at most 16 bits a colour are known: what a decoder would silently
leave out, or show otherwise, is refused. Knows nothing about pixels or OpenCV.

Source: Microsoft, BITMAPFILEHEADER and BITMAPINFOHEADER; Adobe, TIFF revision 6.0, part 1.
"""

from __future__ import annotations

from typing import Literal

from taxel.errors import BadSource
from taxel.jpeg_head import EIGHT_BITS, check_size
from taxel.plain_text import number_of

_BMP = b"BM"
_TIFF: dict[bytes, Literal["little", "big"]] = {b"II*\x00": "little", b"MM\x00*": "big"}
_OLD_HEAD = 12
"""Bytes of the oldest head of a BMP, with sides of two bytes; later ones have sides of four."""
_WIDTH, _HEIGHT, _BITS, _ORIENTATION = 256, 257, 258, 274
_SHORT, _LONG = 3, 4
_MOST_TAGS = 1000
_MOST_BITS = 16
_MEND = "save it as PNG"


def is_raster(image: bytes) -> bool:
    """Return whether bytes begin as those of a BMP or a TIFF."""
    return image.startswith(_BMP) or image[:4] in _TIFF


def raster_size(image: bytes) -> tuple[int, int]:
    """Return the width and height that a BMP or TIFF declares, pixels.

    Raises:
        BadSource: It is neither, is cut short, has several pages or more than 16 bits a colour,
            or is larger than `taxel.jpeg_head.LARGEST_PX`.
    """
    width, height = _bmp(image) if image.startswith(_BMP) else _tiff(image)
    check_size(width, height)
    return width, height


def _bmp(image: bytes) -> tuple[int, int]:
    old = int.from_bytes(image[14:18], "little") == _OLD_HEAD
    size = 2 if old else 4
    across, down = image[18 : 18 + size], image[18 + size : 18 + 2 * size]
    if len(down) < size:
        raise BadSource("a whole BMP image", number_of(len(image), "byte"), "copy it again")
    # A height below 0 says that the rows run downwards.
    signed = not old
    return (
        abs(int.from_bytes(across, "little", signed=signed)),
        abs(int.from_bytes(down, "little", signed=signed)),
    )


def _tiff(image: bytes) -> tuple[int, int]:
    if image[:4] not in _TIFF:
        raise BadSource("a BMP or TIFF image", f"{number_of(len(image), 'byte')} of neither", _MEND)

    def number(at: int, size: int) -> int:
        return _number(image, at, size)

    entries = _entries(image)
    tags = {}
    for at in entries:
        kind, values = number(at + 2, 2), number(at + 4, 4)
        size = {_SHORT: 2, _LONG: 4}.get(kind, 0)
        if size:
            inside = size * values <= 4
            tags[number(at, 2)] = number(at + 8 if inside else number(at + 8, 4), size)
    if number(entries.stop, 4):
        raise BadSource(
            "a TIFF of one image", "one of several", "save each as a file of its own in a folder"
        )
    if tags.get(_BITS, 1) > _MOST_BITS:
        raise BadSource(
            f"a TIFF of at most {_MOST_BITS} bits a colour", f"{tags[_BITS]} bits", EIGHT_BITS
        )
    if not {_WIDTH, _HEIGHT} <= tags.keys():
        raise BadSource("a TIFF that says its size", "one that does not", _MEND)
    return tags[_WIDTH], tags[_HEIGHT]


def _entries(image: bytes) -> range:
    """Return where each tag of a TIFF's first page begins."""
    first = _number(image, 4, 4)
    count = _number(image, first, 2)
    if count > _MOST_TAGS:
        raise BadSource("a TIFF image", f"one of {count} tags", _MEND)
    return range(first + 2, first + 2 + 12 * count, 12)


def _number(image: bytes, at: int, size: int) -> int:
    own = image[at : at + size]
    if len(own) < size:
        raise BadSource("a whole TIFF image", number_of(len(image), "byte"), "copy it again")
    return int.from_bytes(own, _TIFF[image[:4]])


def as_stored(image: bytes) -> bytes:
    """Return a TIFF that does not ask to be turned or mirrored; any other image as it is.

    OpenCV always follows that tag, while it can be asked to leave a JPEG or PNG as it is stored.

    Raises:
        BadSource: The TIFF is cut short, or has too many tags.
    """
    if image[:4] not in _TIFF:
        return image
    order = _TIFF[image[:4]]
    upright = b"".join(
        number.to_bytes(size, order) for number, size in ((_SHORT, 2), (1, 4), (1, 2), (0, 2))
    )
    for at in _entries(image):
        if _number(image, at, 2) == _ORIENTATION:
            image = image[: at + 2] + upright + image[at + 2 + len(upright) :]
    return image
