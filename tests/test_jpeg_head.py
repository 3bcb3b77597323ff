"""Claims about JPEG images: what a camera cannot have sent is refused before it is decoded."""

import ast
import re
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import frame_codec
from taxel.errors import BadSource
from taxel.frame_codec import (
    decode_grey_quarter,
    decode_jpeg,
    decode_still,
    encode_jpeg,
    still_size,
)
from taxel.jpeg_head import LARGEST_PX, JpegHead, fits, read_head
from taxel.signals import CameraInfo

CAMERA = CameraInfo(name="left", width=320, height=240, rate_hz=25.0)
SIZE = (320, 240)
RGB = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
GOOD = encode_jpeg(RGB)


def declare(jpeg: bytes, width: int, height: int) -> bytes:
    """Return a JPEG whose head declares another size; its data stay as they are."""
    at = re.search(rb"\xff[\xc0-\xc2]", jpeg).start()
    return jpeg[: at + 5] + struct.pack(">HH", height, width) + jpeg[at + 9 :]


def coded(*flags: int) -> bytes:
    return cv2.imencode(".jpg", RGB, list(flags))[1].tobytes()


def scans(count: int) -> bytes:
    """Return a small file that asks for many passes over its image."""
    at = GOOD.index(b"\xff\xda")
    length = int.from_bytes(GOOD[at + 2 : at + 4], "big")
    scan = GOOD[at : at + 2 + length] + b"\x00\x00"
    return GOOD[:at] + scan * count + b"\xff\xd9"


PROGRESSIVE = coded(cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
HOSTILE = {
    "a declared size of 20,000 × 20,000": declare(GOOD, 20_000, 20_000),
    "a declared size of 65,535 × 65,535": declare(GOOD, 65_535, 65_535),
    "the height left out": declare(GOOD, 320, 0),
    "a size that is not the camera's": encode_jpeg(RGB[:120]),
    "progressive": PROGRESSIVE,
    "progressive and huge": declare(PROGRESSIVE, 65_000, 65_000),
    "sixty scans": scans(60),
    "two images in one": GOOD[:2] + GOOD[2 : GOOD.index(b"\xff\xda")] * 2 + GOOD[2:],
    "another coding": GOOD.replace(b"\xff\xc0", b"\xff\xc9", 1),
    "lossless": GOOD.replace(b"\xff\xc0", b"\xff\xc3", 1),
    "12 bits": (lambda at: GOOD[: at + 4] + b"\x0c" + GOOD[at + 5 :])(GOOD.index(b"\xff\xc0")),
    "a PNG": cv2.imencode(".png", RGB)[1].tobytes(),
    "a PNG with a JPEG's end": cv2.imencode(".png", RGB)[1].tobytes() + b"\xff\xd9",
    "cut short": GOOD[:500],
    "cut short with an end": GOOD[:300] + b"\xff\xd9",
    "no scan": GOOD[: GOOD.index(b"\xff\xda")] + b"\xff\xd9",
    "a million segments": GOOD[:2] + b"\xff\xe0\x00\x02" * 1_000_000 + GOOD[2:],
    "fill bytes only": GOOD[:2] + b"\xff" * 1_000_000 + b"\xff\xd9",
    "more bytes than pixels": GOOD[:-2] + b"\xff\x00" * 200_000 + b"\xff\xd9",
    "nothing": b"",
    "start and end": b"\xff\xd8\xff\xd9",
}


@pytest.mark.parametrize("what", HOSTILE)
def test_what_a_camera_cannot_have_sent_never_reaches_the_decoder(
    what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded = []
    monkeypatch.setattr(frame_codec.cv2, "imdecode", lambda *_: decoded.append(1))

    for decode in (decode_jpeg, decode_grey_quarter):
        with pytest.raises(BadSource):
            decode(HOSTILE[what], CAMERA)
    assert decoded == []
    assert not fits(HOSTILE[what], SIZE)


def test_without_a_camera_there_is_still_a_largest_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_codec.cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    with pytest.raises(BadSource, match="pixels"):
        decode_jpeg(declare(GOOD, 4096, LARGEST_PX // 4096 + 1), None)


def test_what_cameras_send_is_decoded_as_ever() -> None:
    """Colour, grey, restart marks, optimised tables, padding of the tables: all sequential."""
    grey = cv2.imencode(".jpg", RGB[:, :, 0])[1].tobytes()
    for jpeg in (GOOD, grey, coded(cv2.IMWRITE_JPEG_RST_INTERVAL, 4),
                 coded(cv2.IMWRITE_JPEG_OPTIMIZE, 1)):  # fmt: skip
        bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert np.array_equal(decode_jpeg(jpeg, CAMERA), bgr[:, :, ::-1])
        assert decode_grey_quarter(jpeg, CAMERA).shape == (60, 80)
    assert read_head(GOOD, SIZE) == JpegHead(320, 240, 3)
    assert read_head(grey) == JpegHead(320, 240, 1)


@pytest.mark.parametrize("jpeg", [PROGRESSIVE, GOOD + b"\x00notes", PROGRESSIVE + GOOD])
def test_a_file_of_ones_own_may_be_progressive_and_go_on_behind_its_image(jpeg: bytes) -> None:
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)

    assert still_size(jpeg) == SIZE
    assert np.array_equal(decode_still(jpeg), bgr[:, :, ::-1])
    with pytest.raises(BadSource):
        decode_jpeg(jpeg, CAMERA)


@pytest.mark.parametrize(
    "what",
    sorted(
        set(HOSTILE)
        - {"progressive", "a size that is not the camera's", "a PNG", "a PNG with a JPEG's end"}
    ),
)
def test_what_costs_more_than_its_bytes_is_refused_in_a_file_of_ones_own(
    what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded = []
    monkeypatch.setattr(frame_codec.cv2, "imdecode", lambda *_: decoded.append(1))
    with pytest.raises(BadSource):
        decode_still(HOSTILE[what])
    assert decoded == []


def test_a_progressive_file_of_many_passes_is_refused() -> None:
    at = PROGRESSIVE.index(b"\xff\xda")
    length = int.from_bytes(PROGRESSIVE[at + 2 : at + 4], "big")
    scan = PROGRESSIVE[at : at + 2 + length] + b"\x00\x00"
    with pytest.raises(BadSource, match="32 if progressive"):
        decode_still(PROGRESSIVE[:at] + scan * 33 + b"\xff\xd9")


def segment(mark: int, content: bytes) -> bytes:
    return bytes([0xFF, mark]) + struct.pack(">H", 2 + len(content)) + content


def test_cameras_without_huffman_tables_and_images_with_notes_are_decoded() -> None:
    """MJPG of webcams leaves the standard tables out; EXIF may hold an image, and turn this one."""
    tables = re.compile(rb"\xff\xc4(..)", re.DOTALL)
    bare = GOOD
    while found := tables.search(bare, 0, bare.index(b"\xff\xda")):
        bare = bare[: found.start()] + bare[found.end() - 2 + int.from_bytes(found[1], "big") :]
    assert len(bare) < len(GOOD)
    assert np.array_equal(decode_jpeg(bare, CAMERA), decode_jpeg(GOOD, CAMERA))
    thumbnail = encode_jpeg(RGB[:8, :8])
    turned = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0" + thumbnail
    noted = GOOD[:2] + segment(0xE1, turned) + segment(0xFE, b"a remark") + GOOD[2:]
    assert np.array_equal(decode_jpeg(noted, CAMERA), decode_jpeg(GOOD, CAMERA))
    assert np.array_equal(decode_grey_quarter(noted, CAMERA), decode_grey_quarter(GOOD, CAMERA))


def test_the_message_says_which_size_was_needed_and_which_was_got() -> None:
    with pytest.raises(BadSource, match="needed images of 320 × 240 px; got one of 20000 × 20000"):
        decode_jpeg(declare(GOOD, 20_000, 20_000), CAMERA)


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_whatever_bytes_come_nothing_but_bad_source_is_raised(data: st.DataObject) -> None:
    """Random bytes between the marks, and the good file with some bytes changed."""
    if data.draw(st.booleans()):
        jpeg = b"\xff\xd8" + data.draw(st.binary(max_size=400)) + b"\xff\xd9"
    else:
        changed = bytearray(GOOD)
        for _ in range(data.draw(st.integers(1, 8))):
            changed[data.draw(st.integers(0, 700))] = data.draw(st.integers(0, 255))
        jpeg = bytes(changed)
    try:
        head = read_head(jpeg)
    except BadSource:
        return
    assert 0 < head.width * head.height <= LARGEST_PX


@pytest.mark.slow
def test_every_image_in_the_software_is_decoded_by_the_one_function_that_checks() -> None:
    """No module calls OpenCV's decoder but the codec; each caller says whose image it is."""
    root = Path(taxel.__file__).parent
    for path in root.rglob("*.py"):
        calls = [
            node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)
        ]
        names = [ast.unparse(call.func) for call in calls]
        if path.name != "frame_codec.py":
            assert not any(name.endswith(("imdecode", "imread", "imdecodemulti")) for name in names)
        for call, name in zip(calls, names, strict=True):
            if name.endswith(("decode_jpeg", "decode_grey_quarter")):
                assert len(call.args) == 2, f"{path}:{call.lineno}"
