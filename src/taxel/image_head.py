"""Whether an image is such as its camera sends, before anything is decoded.

JPEG is read by `jpeg_head`. Depth is PNG, 16 bits, grey, not interlaced, of three kinds of chunks
only: a PNG may hold others that unpack to gigabytes. Knows nothing about pixels or OpenCV.

Source: PNG specification (third edition), sections 5 and 11.
"""

from __future__ import annotations

from taxel.errors import BadSource
from taxel.jpeg_head import check_size, fits
from taxel.plain_text import number_of
from taxel.signals import DEPTH_PNG, CameraInfo

_START = b"\x89PNG\r\n\x1a\n"
_HEAD, _DATA, _END = b"IHDR", b"IDAT", b"IEND"
_HEAD_BYTES = 13
_SIXTEEN_GREY = bytes((16, 0, 0, 0, 0))
"""Bit depth, grey, and compression, filter and interlacing that every PNG of this kind has."""
_AROUND = 12
"""Bytes of a chunk beside its data: length, kind, check sum."""
_SPARE_BYTES = 1 << 16
"""A PNG may be so much larger than its raw pixels, bytes: noise is. Source: our choice,
docs/decisions/0052."""
_MEND = "check the camera's cable, or where the recording comes from"


def is_sound(image: bytes, camera: CameraInfo) -> bool:
    """True for an image of the camera's size and coding that may be decoded."""
    size = camera.width, camera.height
    if camera.coding != DEPTH_PNG:
        return fits(image, size)
    try:
        read_png16(image, size)
    except BadSource:
        return False
    return True


def read_png16(png: bytes, size: tuple[int, int]) -> None:
    """Refuse what is no whole PNG of 16 bits and of a size.

    Args:
        png: The image.
        size: (width, height) that it must have, pixels.

    Raises:
        BadSource: It is none, cut short, of another size or coding, or too large.
    """
    check_size(*size)
    if not png.startswith(_START):
        raise BadSource("a PNG image", f"{number_of(len(png), 'byte')} without one", _MEND)
    if len(png) > 2 * size[0] * size[1] + _SPARE_BYTES:
        raise BadSource("a PNG no larger than its pixels", f"{len(png):,} bytes", _MEND)
    kinds, at = [], len(_START)
    while at < len(png):
        length = int.from_bytes(png[at : at + 4], "big")
        kinds.append(png[at + 4 : at + 8])
        if kinds[-1] == _HEAD:
            _check_head(png[at + 8 : at + 8 + length], size)
        at += _AROUND + length
    whole = at == len(png) and len(kinds) >= 3
    if not whole or kinds[0] != _HEAD or kinds[-1] != _END or set(kinds[1:-1]) != {_DATA}:
        raise BadSource("a whole PNG of a head, data and an end", "another", _MEND)


def _check_head(head: bytes, size: tuple[int, int]) -> None:
    wanted = size[0].to_bytes(4, "big") + size[1].to_bytes(4, "big") + _SIXTEEN_GREY
    if len(head) != _HEAD_BYTES or head != wanted:
        raise BadSource(
            f"a depth image of {size[0]} × {size[1]} px, 16 bits grey", "another", _MEND
        )
