"""Claims about imported videos: frames come in pairs, and what cannot be trusted is refused."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.frame_codec import decode_jpeg
from taxel.recordings.known import KNOWN_VIDEOS
from taxel.recordings.reader import iterate_frames, read_manifest
from taxel.recordings.video_rows import VideoRow, read_video_rows
from taxel.recordings.videos import import_videos


def write(path: Path, frames: int = 20, rate_hz: float = 25.0, grey: bool = False) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate_hz, (64, 48))
    for number in range(frames):
        image = np.full((48, 64, 3), (20, 90, 160), np.uint8)
        if grey:
            image[:] = 90
        image[:, 3 * number : 3 * number + 8] = 250
        writer.write(image)
    writer.release()
    return path


@pytest.fixture
def pair(tmp_path: Path) -> dict[str, Path]:
    return {side: write(tmp_path / f"{side}.avi") for side in ("left", "right")}


def run(files: dict[str, Path], output: Path) -> Path:
    (made,) = import_videos([VideoRow(name="a", files=files)], output)
    return made


def test_a_pair_becomes_a_recording(tmp_path: Path, pair: dict[str, Path]) -> None:
    """Red stays red, times are frame number over rate, and the bar moves as it did."""
    made = run(pair, tmp_path / "out")
    frames = list(iterate_frames(made))
    assert [(f.camera, f.counter) for f in frames] == [(c, n) for n in range(20) for c in (0, 1)]
    assert frames[10].fitted_s == pytest.approx(5 / 25.0)
    assert [camera.name for camera in read_manifest(made).cameras] == ["left", "right"]
    image = decode_jpeg(frames[0].jpeg)
    assert np.abs(image[24, 40].astype(int) - (160, 90, 20)).max() < 12
    bars = [np.flatnonzero(decode_jpeg(f.jpeg)[24, :, 2] > 130).mean() for f in frames[::2]]
    assert np.all(np.diff(bars) > 1)
    assert bars[-1] > bars[0] + 40


def truncated(path: Path) -> Path:
    write(path, 40)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    return path


BAD = {
    "empty": (lambda path: (path.write_bytes(b""), path)[1], "without any"),
    "cut short": (truncated, "cut short|without any"),
    "grey": (lambda path: write(path, grey=True), "grey"),
    "longer": (lambda path: write(path, 30), "20 and 30"),
    "slower": (lambda path: write(path, rate_hz=10.0), "10 Hz and 25 Hz"),
    "missing": (lambda path: path, "no file"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_faulty_partner_is_refused_in_one_line(
    tmp_path: Path, pair: dict[str, Path], fault: str
) -> None:
    make, words = BAD[fault]
    pair["right"] = make(tmp_path / "bad.avi")
    with pytest.raises(BadTable, match=words) as error:
        run(pair, tmp_path / "out")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_table_names_videos_labels_and_groups(tmp_path: Path, pair: dict[str, Path]) -> None:
    table = tmp_path / "table.csv"
    table.write_text("left,right,label:outcome,group:object,rate\nleft.avi,right.avi,slip,mug,30\n")
    (row,) = read_video_rows(table, tmp_path)
    assert (row.labels, row.groups["object"], row.rate_hz) == ({"outcome": "slip"}, "mug", 30.0)
    (made,) = import_videos([row], tmp_path / "out")
    assert read_manifest(made).cameras[0].rate_hz == 30.0
    assert list(iterate_frames(made))[2].fitted_s == pytest.approx(1 / 30)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "right\nb.avi\n",
        "left,colour\na.avi,red\n",
        "left,right\na.avi,\n",
        "left,rate\na.avi,x\n",
    ],
)
def test_a_bad_table_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(BadTable):
        read_video_rows(tmp_path / "table.csv", tmp_path)


@pytest.mark.real
def test_the_public_slip_set_is_understood() -> None:
    """29 objects, 150 trials, 65 slips, as the data set's page says."""
    folder = Path(__file__).parents[3] / "shared" / "data" / "gelsight-slip"
    if not folder.is_dir():
        pytest.skip("the recordings of gelsight-slip are not here")
    rows = KNOWN_VIDEOS["gelsight-slip"](folder)
    assert len(rows) == 150
    assert len({row.groups["object"] for row in rows}) == 29
    assert sum(row.labels["outcome"] == "slip" for row in rows) == 65
