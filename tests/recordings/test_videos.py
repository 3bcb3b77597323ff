"""Claims about imported videos: frames come in pairs, and what cannot be trusted is refused."""

from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from taxel.cli.recordings.import_ import Import
from taxel.errors import BadTable
from taxel.frame_codec import decode_jpeg
from taxel.recordings.imports.footage import Video, open_footage
from taxel.recordings.imports.known import KNOWN_VIDEOS
from taxel.recordings.imports.video_rows import VideoRow, names_videos, read_video_rows
from taxel.recordings.imports.videos import import_videos
from taxel.recordings.reader import iterate_frames, read_manifest
from taxel.recordings.summary import summarise


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
    image = decode_jpeg(frames[0].jpeg, None)
    assert np.abs(image[24, 40].astype(int) - (160, 90, 20)).max() < 12
    bars = [np.flatnonzero(decode_jpeg(f.jpeg, None)[24, :, 2] > 130).mean() for f in frames[::2]]
    assert np.all(np.diff(bars) > 1)
    assert bars[-1] > bars[0] + 40


def truncated(path: Path) -> Path:
    write(path, 40)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    return path


def padded(path: Path) -> Path:
    """The second half was never written, as after a copy that was broken off."""
    write(path)
    content = path.read_bytes()
    half = len(content) // 2
    path.write_bytes(content[:half] + bytes(len(content) - half))
    return path


def understated(path: Path) -> Path:
    """Twice as many frames as both of its heads say."""
    content = bytearray(write(path, 40).read_bytes())
    for head, place in ((b"avih", 24), (b"strh", 40)):
        content[content.index(head) + place : content.index(head) + place + 4] = b"\x14\0\0\0"
    path.write_bytes(content)
    return path


BAD = {
    "understated": (understated, "the 20 frames that .* says it has; got more"),
    "empty": (lambda path: (path.write_bytes(b""), path)[1], "without any"),
    "cut short": (truncated, "cut short|without any"),
    "padded": (padded, "cut short|without any"),
    "no video": (lambda path: (path.write_bytes(b"left, right" * 99), path)[1], "without any"),
    "grey": (lambda path: write(path, grey=True), "grey"),
    "longer": (lambda path: write(path, 30), r"20 in .*left\.avi and 30 in .*bad\.avi"),
    "slower": (lambda path: write(path, rate_hz=10.0), r"10 Hz in .*bad\.avi and 25 Hz in .*left"),
    "missing": (lambda path: path, "no file"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_faulty_partner_is_refused_in_one_line(
    tmp_path: Path, pair: dict[str, Path], fault: str
) -> None:
    """Nothing is left behind."""
    make, words = BAD[fault]
    pair["right"] = make(tmp_path / "bad.avi")
    with pytest.raises(BadTable, match=words) as error:
        run(pair, tmp_path / "out")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()
    assert not list(tmp_path.glob(".taxel-import-*"))


@pytest.mark.parametrize("name", ["10:30.mp4", "file:x.mp4"])
def test_a_video_may_be_called_by_the_time_of_day(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = tmp_path / "plain.mp4"
    writer = cv2.VideoWriter(str(plain), cv2.VideoWriter.fourcc(*"mp4v"), 25.0, (64, 48))
    for level in range(20):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    plain.rename(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert len(list(Video(Path(name)).frames())) == 20


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
        "left,right\na.avi,b.avi,c\n",
        "left,left\na.avi,b.avi\n",
        "left,camera:left\na.avi,b.avi\n",
        "left,label:outcome\na.avi,\n",
        "left,label:outcome\na.avi\n",
        "left,label:\na.avi,x\n",
    ],
)
def test_a_bad_table_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(BadTable):
        read_video_rows(tmp_path / "table.csv", tmp_path)


@pytest.mark.parametrize(
    ("cell", "mend"), [("b.png", "check the path"), ("*.png", "write a row for each trial")]
)
def test_a_file_that_is_not_there_is_named_with_its_line(
    tmp_path: Path, cell: str, mend: str
) -> None:
    """Images are called images; a table of hundreds of rows shows where to look."""
    (tmp_path / "a.png").touch()
    (tmp_path / "table.csv").write_text(f"camera:gel,label:x\na.png,1\n{cell},2\n")
    with pytest.raises(BadTable) as error:
        read_video_rows(tmp_path / "table.csv", tmp_path)
    assert error.value.needed == "a video, an image or a folder of images for each camera"
    assert error.value.got.endswith("table.csv, line 3)")
    assert error.value.mend.startswith(mend)


def test_a_table_from_a_spreadsheet_is_read(tmp_path: Path) -> None:
    """With the mark that spreadsheets put first, and blank lines and columns at the end."""
    text = b"\xef\xbb\xbfleft,right,,\r\n,,,\r\na.avi,b.avi,,\r\n,,,\r\n\r\n"
    (tmp_path / "table.csv").write_bytes(text)
    for name in ("a.avi", "b.avi"):
        (tmp_path / name).touch()
    (row,) = read_video_rows(tmp_path / "table.csv", tmp_path)
    assert row.files == {"left": tmp_path / "a.avi", "right": tmp_path / "b.avi"}


def test_the_tables_own_words_may_have_capitals(tmp_path: Path) -> None:
    """As in a table of arrays."""
    (tmp_path / "table.csv").write_text("Left,Label:Outcome,Rate\na.avi,slip,30\n")
    (tmp_path / "a.avi").touch()
    assert names_videos(["Left"])
    (row,) = read_video_rows(tmp_path / "table.csv", tmp_path)
    assert (set(row.files), row.labels, row.rate_hz) == ({"left"}, {"Outcome": "slip"}, 30.0)


def test_a_pair_of_nearly_one_length_is_cut_to_the_shorter(tmp_path: Path) -> None:
    """Two frames are forgiven, as cameras stop one after the other."""
    files = {"left": write(tmp_path / "l.avi", 22), "right": write(tmp_path / "r.avi", 20)}
    frames = list(iterate_frames(run(files, tmp_path / "out")))
    assert [frame.counter for frame in frames if frame.camera == 0] == list(range(20))
    assert len(frames) == 40


def test_equal_frames_stay_equal(tmp_path: Path) -> None:
    """A frame that the video repeats gives the same bytes, so repeats can be counted."""
    path = tmp_path / "still.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for number in range(12):
        writer.write(np.full((48, 64, 3), (20, 90, 100 + 10 * (number // 3)), np.uint8))
    writer.release()
    made = run({"left": path}, tmp_path / "out")
    assert len({frame.jpeg for frame in iterate_frames(made)}) == 4
    assert summarise(made)["cameras"][0]["repeated"] == 8


@pytest.mark.real
@pytest.mark.parametrize("way", ["one file", "a copy", "others"])
def test_two_cameras_of_the_same_images_are_warned_of(
    tmp_path: Path, pair: dict[str, Path], way: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """As where one file is named for both; one trial of two is enough."""
    (tmp_path / "copy.avi").write_bytes(pair["left"].read_bytes())
    made = cv2.VideoWriter(
        str(tmp_path / "other.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48)
    )
    for number in range(20):
        made.write(np.full((48, 64, 3), (20, 90 + number // 19, 160), np.uint8))
    made.release()
    second = {"one file": "left.avi", "a copy": "copy.avi", "others": "other.avi"}[way]
    table = tmp_path / "table.csv"
    rows = f"left.avi,{second},slip\nleft.avi,other.avi,hold\n"
    table.write_text(f"left,right,label:outcome\n{rows}")

    Import(table=str(table), output=tmp_path / "out").run()

    lines = [line for line in capsys.readouterr().out.splitlines() if "same images" in line]
    warning = (
        "warning: the cameras left and right show the same images in 1 of 2 trials; give each "
        "the files of its own"
    )
    assert lines == ([] if way == "others" else [warning])


def test_the_public_slip_set_is_understood() -> None:
    """29 objects, 150 trials, 65 slips, as the data set's page says."""
    folder = Path(__file__).parents[3] / "shared" / "data" / "gelsight-slip"
    if not folder.is_dir():
        pytest.skip("the recordings of gelsight-slip are not here")
    rows = KNOWN_VIDEOS["gelsight-slip"](folder)
    assert len(rows) == 150
    assert len({row.groups["object"] for row in rows}) == 29
    assert sum(row.labels["outcome"] == "slip" for row in rows) == 65


def test_some_frames_of_a_video_are_those_of_all_of_them(tmp_path: Path) -> None:
    path = write(tmp_path / "a.avi")
    every = list(Video(path).frames())

    some = list(Video(path).frames_at([0, 7, 19]))

    assert all(np.array_equal(a, every[n]) for a, n in zip(some, (0, 7, 19), strict=True))
    with pytest.raises(BadTable, match="frame 25"):
        list(Video(path).frames_at([25]))


def stills(folder: Path, *names: str) -> Path:
    folder.mkdir()
    for name in names:
        assert cv2.imwrite(str(folder / name), np.full((24, 32, 3), 90, np.uint8))
    return folder


def test_images_whose_order_their_names_leave_open_are_refused(tmp_path: Path) -> None:
    """Decimals of unlike length: in the order of numbers, 1.5 would come before 1.25."""
    with pytest.raises(BadTable, match=r"got 1\.5 and 1\.25 in .*open: decimals"):
        open_footage(stills(tmp_path / "open", "1.25.png", "1.5.png", "1.75.png"))
    with pytest.raises(BadTable, match=r"got 1\.5 and 1\.50 in"):
        open_footage(stills(tmp_path / "same", "1.5.png", "1.50.png"))
    with pytest.raises(BadTable, match=r"one image a frame; got 1\.(jpg|png) and 1\.(jpg|png)"):
        open_footage(stills(tmp_path / "twice", "1.png", "1.jpg", "2.png"))
    for number, names in enumerate([("1.250.png", "1.500.png", "2.000.png"),
                                    ("a1.png", "a2.png", "a10.png"),
                                    tuple(f"trial1.{n}.png" for n in range(1, 13)),
                                    ("12.30.9.png", "12.30.10.png", "12.31.0.png"),
                                    ("t0.5.png", "t0.25.5.png")]):  # fmt: skip
        assert open_footage(stills(tmp_path / f"{number}", *names)).count == len(names)


@pytest.mark.parametrize(("at_ms", "uneven"), [
    ([0, 40, 80, 120, 160], False), ([0, 44, 80, 124, 160], False), ([0, 40, 80, 200, 240], True),
])  # fmt: skip
def test_frames_that_are_not_evenly_spaced_are_reported(
    tmp_path: Path, at_ms: list[int], uneven: bool
) -> None:
    """They are taken as if they were, as of every video; jitter below half a period is usual."""
    av = pytest.importorskip("av")
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=25, width=64, height=48, pix_fmt="yuv420p")
        stream.codec_context.time_base = Fraction(1, 1000)
        for time_ms in at_ms:
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), (160, 90, 20), np.uint8))
            frame.pts, frame.time_base = time_ms, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    found: list[Video] = []
    (made,) = import_videos(
        [VideoRow(name="a", files={"pad": path})], tmp_path / "out", on_uneven=found.append
    )

    assert [video.path for video in found] == [path] * uneven
    assert len(list(iterate_frames(made))) == len(at_ms)
    if uneven:
        assert found[0].steps_s == pytest.approx((0.04, 0.12))


def encoded(path: Path, codec: str, frames: int = 30) -> Path:
    """Write a video of some coding."""
    av = pytest.importorskip("av")
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, width=64, height=48, pix_fmt="yuv420p")
        for number in range(frames):
            image = np.full((48, 64, 3), (160, 90, 20), np.uint8)
            image[:, number : number + 8] = 250
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image)))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("ending", [".mkv", ".mov"])
def test_a_video_of_which_no_frame_can_be_decoded_is_refused(tmp_path: Path, ending: str) -> None:
    """As AV1 where OpenCV cannot decode it: Matroska gave a recording without frames."""
    av = pytest.importorskip("av")
    path = tmp_path / f"a{ending}"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25, width=64, height=48, pix_fmt="yuvj420p")
        for number in range(20):
            packet = av.Packet(b"no image at all")
            packet.stream, packet.time_base = stream, Fraction(1, 25)
            packet.pts = packet.dts = number
            container.mux(packet)
    with pytest.raises(BadTable, match=f"can be decoded; got .*a{ending}, of which none can"):
        run({"pad": path}, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["a.mpg", "a.mpeg"])
def test_the_frames_of_an_mpeg_file_are_counted(tmp_path: Path, name: str) -> None:
    """Such a file does not say how many it holds: it was refused with "says it has; got more"."""
    path = encoded(tmp_path / name, "mpeg2video")
    assert len(list(iterate_frames(run({"pad": path}, tmp_path / "out")))) == 30


def test_frames_without_a_time_are_not_reported_as_uneven(tmp_path: Path) -> None:
    """FFmpeg knows no time of the last frames of an AVI in H.264: "-1.16 to 0.04 s apart"."""
    path = encoded(tmp_path / "a.avi", "libx264")
    found: list[Video] = []
    import_videos(
        [VideoRow(name="a", files={"pad": path})], tmp_path / "out", on_uneven=found.append
    )
    assert found == []
