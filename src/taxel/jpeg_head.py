"""What a JPEG says of itself before anything is decoded: its size, coding and scans.

A file of 673 bytes can declare 20,000 × 20,000 pixels or a thousand passes over the image, so
that decoding it takes gigabytes or half a minute. Tactile cameras send sequential 8-bit JPEG with
Huffman coding, at most one scan a colour component; anything else is refused here, in time linear
in the bytes. A file of one's own may also be progressive, and go on behind its image as those of
phones do. Knows nothing about pixels, cameras or OpenCV.

Source: ITU-T T.81, annex B (markers) and table B.1.

Background of our choices: docs/decisions/0031.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from taxel.errors import BadSource
from taxel.plain_text import number_of

LARGEST_PX = 1 << 24
"""Pixels of the largest image that is ever decoded: 4096 × 4096, twice the 3280 × 2464 of a
GelSight's sensor; 48 MiB decoded. Source: our choice, docs/decisions/0031."""

_START, _END = b"\xff\xd8", b"\xff\xd9"
_SEQUENTIAL = (0xC0, 0xC1)
"""Baseline and extended sequential, Huffman-coded. Source: T.81, table B.1."""
_PROGRESSIVE = 0xC2
"""Progressive, Huffman-coded. Source: as above."""
_MOST_PASSES = 32
"""Scans of a progressive file of one's own: libjpeg writes ten. Source: our choice,
docs/decisions/0031."""
_FRAMES = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""Markers that begin a frame; C4 is Huffman tables, C8 reserved, CC arithmetic conditioning."""
_SCAN, _END_MARK = 0xDA, 0xD9
_ALONE = frozenset({0x01, *range(0xD0, 0xD9)})
"""Markers without a length: TEM, restarts, a second start of an image."""
_COMPONENTS = (1, 3)
"""Grey, or luminance and two colours."""
_INKS = {4: " (CMYK, as for print)"}
"""What a number of components that is not decoded usually is."""
_FILL = re.compile(rb"\xff+")
"""What stands before a marker's code: fill bytes may stand there, too."""
_IN_DATA = frozenset({0x00, *range(0xD0, 0xD8), 0xFF})
"""What follows FF within entropy-coded data: a stuffed zero, a restart, a fill byte."""
_SPARE_BYTES = 1 << 16
"""A JPEG may be so much larger than its raw pixels, bytes: noise at full quality is. Our choice."""
_MOST_SEGMENTS = 256
"""Segments of one image: cameras send about ten. Source: our choice, docs/decisions/0031."""
_MEND = "check the camera's cable, or where the recording comes from"
EIGHT_BITS = (
    "save it as PNG in 8-bit RGB or grey, as with: magick OLD -colorspace sRGB -depth 8 NEW.png"
)
"""How to mend an image file of other colours or bits than are read."""


@dataclass(frozen=True, slots=True)
class JpegHead:
    """What a JPEG declares."""

    width: int
    """Pixels a row."""
    height: int
    """Rows."""
    components: int
    """1 grey, 3 colour."""


def read_head(
    jpeg: bytes, size: tuple[int, int] | None = None, *, own_file: bool = False
) -> JpegHead:
    """Return what a JPEG declares, once all that it declares is fit to be decoded.

    Args:
        jpeg: The whole image, from its start mark to its end mark.
        size: (width, height) that it must have, pixels; None takes any up to `LARGEST_PX`.
        own_file: Whether it is a file of one's own, which may be progressive and go on behind
            its end mark; a camera's frame may not.

    Raises:
        BadSource: It is no JPEG or cut short, of another size, too large, or of a coding that
            tactile cameras do not send: progressive, lossless, arithmetic, 12 bits, many scans.
    """
    if not jpeg.startswith(_START) or not (jpeg.endswith(_END) or (own_file and _END in jpeg)):
        raise BadSource("a whole JPEG image", f"{number_of(len(jpeg), 'byte')} without one", _MEND)
    head: JpegHead | None = None
    scans, most_scans, at = 0, 0, 2
    for _ in range(_MOST_SEGMENTS):
        mark, at = _next_mark(jpeg, at)
        if mark == _END_MARK:
            break
        if mark in _ALONE:
            continue
        end = at + _length(jpeg, at)
        if mark in _FRAMES:
            if head is not None:
                raise BadSource("a JPEG of one image", "one with several frames", _MEND)
            head, most_scans = _frame(mark, jpeg[at + 2 : end], size, own_file=own_file)
            most = 3 * head.width * head.height + _SPARE_BYTES
            if len(jpeg) > most:
                raise BadSource(f"at most {most:,} bytes for its size", f"{len(jpeg):,}", _MEND)
        elif mark == _SCAN:
            scans += 1
            if head is None or scans > most_scans:
                raise BadSource(
                    "a JPEG with at most one scan a colour"
                    + (f", or {_MOST_PASSES} if progressive" if own_file else ""),
                    f"one with {scans} or more", _MEND,
                )  # fmt: skip
            end = _data_end(jpeg, end)
        at = end
    else:
        raise BadSource(f"a JPEG of at most {_MOST_SEGMENTS} segments", "one of more", _MEND)
    if head is None or not scans:
        raise BadSource("a JPEG with an image in it", "one with none", _MEND)
    return head


def fits(jpeg: bytes, size: tuple[int, int]) -> bool:
    """True for a JPEG that may be decoded and has a size, (width, height) in pixels."""
    try:
        read_head(jpeg, size)
    except BadSource:
        return False
    return True


def _next_mark(jpeg: bytes, at: int) -> tuple[int, int]:
    """Return the marker that begins at a place, and where it ends; fill bytes are skipped."""
    fill = _FILL.match(jpeg, at)
    if fill is None or fill.end() >= len(jpeg):
        raise BadSource("a whole JPEG image", f"no marker at byte {at} of {len(jpeg)}", _MEND)
    return jpeg[fill.end()], fill.end() + 1


def _data_end(jpeg: bytes, at: int) -> int:
    """Return where the first marker behind entropy-coded data begins: its end mark at the latest.

    Looks at each FF; a pattern for the marker takes ten times longer on what cameras send.
    """
    last = len(jpeg) - 2
    while (at := jpeg.find(0xFF, at, last)) >= 0 and jpeg[at + 1] in _IN_DATA:
        at += 1
    return last if at < 0 else at


def _length(jpeg: bytes, at: int) -> int:
    """Return the length of the segment whose length stands at a place, itself included."""
    length = int.from_bytes(jpeg[at : at + 2], "big")
    if length < 2 or at + length > len(jpeg):
        raise BadSource(
            "a whole JPEG image",
            f"a segment of {number_of(length, 'byte')} at byte {at} of {len(jpeg)}",
            _MEND,
        )
    return length


def _frame(
    mark: int, body: bytes, size: tuple[int, int] | None, *, own_file: bool
) -> tuple[JpegHead, int]:
    """Return a frame header's content, and how many scans the frame may have.

    Raises:
        BadSource: It is of a kind that is not decoded.
    """
    progressive = own_file and mark == _PROGRESSIVE
    if mark not in _SEQUENTIAL and not progressive:
        raise BadSource(
            "a sequential JPEG, as cameras send it", f"coding {mark - 0xC0} (2: progressive)", _MEND
        )
    components = body[5] if len(body) > 5 else 0
    if len(body) != 6 + 3 * components or components not in _COMPONENTS or body[0] != 8:
        bits = number_of(body[0] if body else 0, "bit")
        raise BadSource(
            "images of 8 bits in RGB or grey",
            f"a JPEG of {bits} in {number_of(components, 'channel')}{_INKS.get(components, '')}",
            EIGHT_BITS if own_file else _MEND,
        )
    height, width = int.from_bytes(body[1:3], "big"), int.from_bytes(body[3:5], "big")
    if size is not None and (width, height) != size:
        raise BadSource(
            f"images of {size[0]} × {size[1]} px", f"one of {width} × {height} px", _MEND
        )
    check_size(width, height)
    return JpegHead(width, height, components), _MOST_PASSES if progressive else components


def check_size(width: int, height: int) -> None:
    """Refuse a size that no tactile camera has.

    Raises:
        BadSource: It is empty, or larger than `LARGEST_PX`.
    """
    if not 0 < width * height <= LARGEST_PX or width < 0:
        raise BadSource(
            f"images of 1 to {LARGEST_PX:,} pixels", f"one of {width} × {height} px", _MEND
        )
