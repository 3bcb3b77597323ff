"""Arrays of images as footage: read a frame at a time, refused unless 8-bit images."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.footage import open_footage
from taxel.recordings.imports.video_rows import read_video_rows
from taxel.recordings.imports.videos import import_videos
from taxel.windows.camera_trials import read_camera_trials

FRAMES = np.random.default_rng(0).integers(0, 256, (7, 30, 44, 3), np.uint8)


def saved(tmp_path: Path, array: np.ndarray) -> Path:
    path = tmp_path / "touch.npy"
    np.save(path, array, allow_pickle=array.dtype == object)
    return path


@pytest.mark.parametrize("order", ["C", "F"])
def test_an_array_of_colour_images_is_footage_red_first(tmp_path: Path, order: str) -> None:
    footage = open_footage(saved(tmp_path, np.asarray(FRAMES, order=order)))

    assert (footage.count, footage.width, footage.height) == (7, 44, 30)
    np.testing.assert_array_equal(list(footage.frames()), FRAMES)


@pytest.mark.parametrize("grey", [FRAMES[..., 0], FRAMES[..., :1]])
def test_grey_images_have_three_equal_colours(tmp_path: Path, grey: np.ndarray) -> None:
    found = np.array(list(open_footage(saved(tmp_path, grey)).frames()))

    np.testing.assert_array_equal(found, FRAMES[..., :1].repeat(3, axis=3))


def test_three_axes_that_end_in_three_colours_are_a_single_image(tmp_path: Path) -> None:
    footage = open_footage(saved(tmp_path, FRAMES[0]))

    assert (footage.count, footage.width, footage.height) == (1, 44, 30)
    np.testing.assert_array_equal(next(iter(footage.frames())), FRAMES[0])


@pytest.mark.parametrize(
    ("array", "got"),
    [
        (FRAMES / 255.0, r"7 × 30 × 44 × 3 float64"),
        (FRAMES * np.uint16(257), r"7 × 30 × 44 × 3 uint16.*of 16 bits divided by 257"),
        (
            np.dstack((FRAMES[0], FRAMES[0, ..., :1]))[None],
            r"44 × 4 uint8.*without a fourth channel",
        ),
        (FRAMES.transpose(0, 3, 1, 2), r"7 × 3 × 30 × 44 uint8"),
        (FRAMES[:0], r"0 × 30 × 44 × 3 uint8"),
        (FRAMES[0, 0, :, 0], r"44 uint8"),
        (np.array(["a", "b"]), "2 texts"),
        (np.zeros((1, 5000, 5000), np.uint8), "5000 × 5000 px"),
        (np.array([{}], dtype=object), "touch.npy|object"),
    ],
)
def test_anything_else_is_refused_with_what_it_is(
    tmp_path: Path, array: np.ndarray, got: str
) -> None:
    with pytest.raises(BadTable, match=got):
        open_footage(saved(tmp_path, array))


def test_a_file_that_is_cut_short_or_missing_is_refused(tmp_path: Path) -> None:
    path = saved(tmp_path, FRAMES)
    path.write_bytes(path.read_bytes()[:-100])

    with pytest.raises(BadTable, match="shape"):
        open_footage(path)
    with pytest.raises(BadTable, match=r"none\.npy"):
        open_footage(tmp_path / "none.npy")


def test_a_table_may_name_arrays_in_place_and_for_import(tmp_path: Path) -> None:
    for number in range(4):
        np.save(tmp_path / f"touch{number}.npy", FRAMES[: 5 + number])
    table = tmp_path / "trials.csv"
    table.write_text(
        "camera:left,label:slipped,group:object\n"
        + "".join(f"touch{n}.npy,{n % 2},{n // 2}\n" for n in range(4))
    )

    trials = read_camera_trials(table)
    files = import_videos(read_video_rows(table, tmp_path), tmp_path / "trials")

    assert [trial.frames for trial in trials] == [5, 6, 7, 7]
    np.testing.assert_array_equal(list(trials[1].read(0)), FRAMES[:6])
    assert len(files) == 4
