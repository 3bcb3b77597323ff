"""Single images as footage: their heads are read before they are decoded, names tell them apart."""

from pathlib import Path, PurePath

import cv2
import numpy as np
import pytest

from taxel.errors import BadSource, BadTable
from taxel.frame_codec import decode_still, still_size
from taxel.raster_head import raster_size
from taxel.recordings.imports.footage import coloured, open_footage
from taxel.recordings.imports.video_rows import names_apart, read_video_rows

IMAGE = np.random.default_rng(0).integers(0, 256, (30, 44, 3), np.uint8)


def coded(ending: str, image: np.ndarray = IMAGE) -> bytes:
    done, found = cv2.imencode(ending, image)
    assert done
    return found.tobytes()


@pytest.mark.parametrize("ending", [".png", ".bmp", ".tif", ".TIFF"])
@pytest.mark.parametrize("grey", [False, True])
def test_an_image_is_footage_of_one_frame(tmp_path: Path, ending: str, grey: bool) -> None:
    own = IMAGE[..., 0] if grey else IMAGE
    path = tmp_path / f"a{ending}"
    path.write_bytes(coded(ending.lower(), own))
    footage = open_footage(path)
    (rgb,) = footage.frames()
    assert (footage.count, footage.width, footage.height) == (1, 44, 30)
    np.testing.assert_array_equal(
        rgb, cv2.cvtColor(own, cv2.COLOR_GRAY2RGB) if grey else own[..., ::-1]
    )


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("turned", [1, 3, 6])
@pytest.mark.parametrize("kind", [3, 4])
def test_a_tiff_is_read_as_it_is_stored_however_it_asks_to_be_turned(
    order: str, turned: int, kind: int
) -> None:
    """As a JPEG or PNG is: turned by 90°, it had another size than the one that it declares."""
    grey = IMAGE[..., 0]
    height, width = grey.shape
    tags = [(256, 3, width), (257, 3, height), (258, 3, 8), (259, 3, 1), (262, 3, 1),
            (273, 4, 0), (274, kind, turned), (277, 3, 1), (278, 3, height),
            (279, 4, grey.size)]  # fmt: skip
    start = len(tiff(tags, order))
    tags[5] = (273, 4, start)
    image = tiff(tags, order) + grey.tobytes()

    assert still_size(image) == (width, height)
    np.testing.assert_array_equal(decode_still(image)[..., 0], grey)


def test_heads_of_bmp_and_tiff_say_their_size_in_either_order_of_bytes() -> None:
    assert raster_size(coded(".bmp")) == (44, 30)
    assert raster_size(coded(".tif")) == (44, 30)
    upright = bytearray(coded(".bmp"))
    upright[22:26] = (-30).to_bytes(4, "little", signed=True)
    assert raster_size(bytes(upright)) == (44, 30)
    old = b"BM" + bytes(12) + (12).to_bytes(4, "little") + bytes((44, 0, 30, 0))
    assert raster_size(old) == (44, 30)
    assert raster_size(tiff([(256, 3, 44), (257, 4, 30)], "big")) == (44, 30)


def tiff(tags: list[tuple[int, int, int]], order: str = "little", more: int = 0) -> bytes:
    """A TIFF's head: tag, kind (3 short, 4 long) and value."""
    head = b"II*\x00" if order == "little" else b"MM\x00*"
    text = head + (8).to_bytes(4, order) + len(tags).to_bytes(2, order)
    for tag, kind, value in tags:
        size = 2 if kind == 3 else 4
        own = value.to_bytes(size, order).ljust(4, b"\x00")
        text += tag.to_bytes(2, order) + kind.to_bytes(2, order) + (1).to_bytes(4, order) + own
    return text + more.to_bytes(4, order)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (tiff([(256, 3, 44), (257, 3, 30)], more=400), "one of several; save each"),
        (
            tiff([(256, 3, 44), (257, 3, 30), (258, 3, 32)]),
            "16 bits a colour; got 32 bits; .*8-bit RGB",
        ),
        (tiff([(256, 3, 44)]), "says its size"),
        (tiff([(256, 4, 90_000), (257, 4, 90_000)]), "90000"),
        (tiff([(256, 3, 44)])[:15], "a whole TIFF"),
        (b"II*\x00\x08\x00\x00\x00\xff\xff", "65535 tags"),
        (b"BM" + bytes(10), "a whole BMP"),
        (b"II+\x00" + bytes(20), "of neither"),
    ],
)
def test_what_a_decoder_would_hide_is_refused(image: bytes, message: str) -> None:
    with pytest.raises(BadSource, match=message):
        raster_size(image)


@pytest.mark.parametrize("ending", [".png", ".jpg", ".bmp", ".tif"])
def test_a_damaged_image_is_one_plain_line_and_no_video(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"a{ending}").write_bytes(coded(ending)[:9])
    with pytest.raises(BadTable, match=f"a{ending}") as error:
        list(open_footage(tmp_path / f"a{ending}").frames())
    assert "video" not in str(error.value)


@pytest.mark.parametrize(
    ("bits", "channels", "got"),
    [(8, 4, "8 bits in 4 channels (CMYK"), (12, 1, "12 bits in 1 channel")],
)
def test_a_jpeg_of_other_colours_or_bits_is_refused_with_how_to_save_it(
    tmp_path: Path, bits: int, channels: int, got: str
) -> None:
    """As programs for print write them: OpenCV would guess their colours."""
    jpeg = coded(".jpg", IMAGE[..., 0])
    at = jpeg.index(b"\xff\xc0")
    parts = b"".join(bytes((part, 17, 0)) for part in range(1, channels + 1))
    head = bytes((bits,)) + jpeg[at + 5 : at + 9] + bytes((channels,)) + parts
    length = (len(head) + 2).to_bytes(2, "big")
    for name in ("1.jpg", "2.jpg"):
        (tmp_path / name).write_bytes(jpeg[: at + 2] + length + head + jpeg[at + 13 :])

    with pytest.raises(BadTable) as error:
        open_footage(tmp_path)

    assert error.value.needed == "images of 8 bits in RGB or grey, as PNG, JPEG, BMP or TIFF"
    assert error.value.got.startswith(f"{tmp_path / '1.jpg'}: a JPEG of {got}")
    assert "8-bit RGB or grey" in error.value.mend
    assert "-colorspace sRGB" in error.value.mend


def test_folders_tell_files_of_one_name_apart() -> None:
    def called(*paths: str) -> list[str]:
        return names_apart([PurePath(path) for path in paths])

    assert called("set/a.avi", "set/b.avi") == ["a", "b"]
    trials = ("mug/try_1/camera_0.avi", "mug/try_2/camera_0.avi", "can/try_1/camera_0.avi")
    assert called(*trials) == ["mug-try_1", "mug-try_2", "can-try_1"]
    assert called("set/new/1/c.avi", "set/new/2/c.avi") == ["1", "2"]
    assert called("a/x.avi", "b/x.avi", "b/y.avi") == ["a-x", "b-x", "y"]
    assert called("x.avi", "b/x.avi") == ["x", "b"]
    assert called("a/x.avi", "a/x.avi") == ["x", "x"]


def test_a_trial_s_name_holds_the_folders_that_tell_it_apart(tmp_path: Path) -> None:
    for name in ("a/1/l.avi", "a/1/r.avi", "a/2/l.avi", "a/2/r.avi"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    table = tmp_path / "trials.csv"
    table.write_text("left,right\na/1/l.avi,a/1/r.avi\na/2/l.avi,a/2/r.avi\n")
    assert [row.name for row in read_video_rows(table, tmp_path)] == ["0001-1", "0002-2"]


def test_hidden_files_beside_the_images_are_no_frames(tmp_path: Path) -> None:
    """macOS leaves ._frame1.png, a few bytes, beside each image on a stick."""
    (tmp_path / "frame1.png").write_bytes(coded(".png"))
    (tmp_path / "._frame1.png").write_bytes(b"Mac OS X")

    assert open_footage(tmp_path).count == 1


def test_a_pattern_in_a_table_of_videos_is_refused_by_its_reason(tmp_path: Path) -> None:
    """In tables of arrays such a cell stands for many files, so people write it here too."""
    with pytest.raises(BadTable, match="write a row for each trial"):
        open_footage(tmp_path / "{label:object}_*.png")


def test_a_path_with_back_slashes_is_refused_by_how_to_write_it(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b.png").write_bytes(coded(".png"))
    (tmp_path / "t.csv").write_text("camera:g,label:k\na\\b.png,0\n")
    with pytest.raises(BadTable, match=r"line 2\); write / where the path has \\\."):
        read_video_rows(tmp_path / "t.csv", tmp_path)


def test_an_empty_png_is_not_called_a_jpeg(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(BadTable, match=r"needed images .* PNG, JPEG, .*a\.png: 0 bytes of none; "):
        open_footage(tmp_path / "a.png")


def test_nearly_black_images_are_not_called_grey(tmp_path: Path) -> None:
    """Twelve bits in a file of sixteen leave no colour above the limit for grey."""
    cv2.imwrite(str(tmp_path / "a.png"), (IMAGE // 4).astype(np.uint16) * 16)
    with pytest.raises(BadTable, match=r"nearly black ones .*; if the file holds 10 or 12 bits"):
        list(coloured(open_footage(tmp_path / "a.png")))
