"""Claims about ROS 2 bags, Parquet tables and videos: other programs read what was recorded."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset
from taxel.exchange.ros2_bag import ros_topic, ros_topics, write_bags
from taxel.frame_codec import encode_jpeg
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.reader import iterate_frames, read_manifest, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo


@pytest.mark.parametrize(
    ("recorded", "written"),
    [
        ("/camera/left", "/camera/left"),
        ("/camera/left_2", "/camera/left_2"),
        ("/camera/left-2", "/camera/left_2"),
        ("/touch/my pad", "/touch/my_pad"),
        ("/camera/0", "/camera/n0"),
        ("/camera/a__b_", "/camera/a_b"),
        ("/camera/左", "/camera/n"),
    ],
)
def test_topics_of_a_bag_are_names_that_ros_accepts(recorded, written):
    assert ros_topic(recorded) == written


def test_two_names_that_become_one_topic_stay_apart():
    assert ros_topic("/camera/left-2", ["/camera/left_2"]) == "/camera/left_2_2"


def test_which_of_two_topics_is_renamed_depends_on_their_names_alone():
    """It was the camera whose image came second: two bags of one rig differed."""
    topics = ["/camera/a b", "/camera/a-b", "/camera/a_b", "/camera/a_b_2"]
    names = {"/camera/a_b": "/camera/a_b", "/camera/a_b_2": "/camera/a_b_2",
             "/camera/a b": "/camera/a_b_3", "/camera/a-b": "/camera/a_b_4"}  # fmt: skip
    assert ros_topics(topics) == ros_topics(reversed(topics)) == names


def test_a_bag_names_cameras_alike_whichever_sees_first(tmp_path):
    cameras = tuple(CameraInfo(name=n, width=8, height=8, rate_hz=25.0) for n in ("l_2", "l-2"))
    jpeg = encode_jpeg(np.zeros((8, 8, 3), np.uint8))
    for first in (0, 1):
        path = tmp_path / f"{first}.mcap"
        with Recorder(path, Manifest.started_now(NO_ARRAY, now_s=0.0, cameras=cameras)) as recorder:
            for number, camera in enumerate((first, 1 - first, 1)):
                recorder.frame(
                    Frame(camera=camera, counter=number, device_s=0.0, arrival_s=0.1 * number,
                          fitted_s=0.1 * number, jpeg=jpeg)
                )  # fmt: skip
    counts = write_bags([tmp_path / "0.mcap", tmp_path / "1.mcap"], tmp_path / "bags")
    assert counts["0"] == counts["1"] == {"/camera/l_2": 1, "/camera/l_2_2": 2}


def test_rosbags_reads_a_bag_folder_with_every_message(make, tmp_path):
    """Images as they came, touch with names and units, marks as JSON in a String."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    typesys = pytest.importorskip("rosbags.typesys")
    path = make(tmp_path / "a.mcap")
    counts = write_bags([path], tmp_path / "bags")["a"]
    assert counts == {"/touch/teng": 1600, "/camera/left": 40, "/camera/right": 40, "/marks": 2}
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    message = (tmp_path / "bags/taxel_msgs/msg/TactileState.msg").read_text()
    store.register(typesys.get_types_from_msg(message, "taxel_msgs/msg/TactileState"))
    found: dict[str, list] = {topic: [] for topic in counts}
    with rosbag2.Reader(tmp_path / "bags/a") as reader:
        assert reader.message_count == sum(counts.values())
        for connection, _, content in reader.messages():
            message = store.deserialize_cdr(content, connection.msgtype)
            found[connection.topic].append(message)
    ours = read_recording(path).samples
    for i in (0, 5, 1599):
        state = found["/touch/teng"][i]
        assert (state.names, state.units) == (["thumb", "index", "palm"], ["V", "V", "V"])
        np.testing.assert_array_equal(state.values, ours.values[i])
        np.testing.assert_array_equal(state.validity, ours.validity[i])
        stamp = state.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == 17 * 10**17 + round(ours.fitted_s[i] * 1e9)
    left = [bytes(message.data) for message in found["/camera/left"]]
    assert left == [frame.jpeg for frame in iterate_frames(path, 0)]
    assert json.loads(found["/marks"][0].data)["labels"] == {"grasp": "stable"}


def _array_from(path, first_s):
    info = SensorInfo(name="pad", channels=("a",), units=("V",), rate_hz=100.0)
    with Recorder(path, Manifest(sensor=info)) as recorder:
        times = first_s + np.arange(100) / 100
        recorder.write(Samples.from_values(np.ones((100, 1)), times))
        recorder.mark(Mark(start_s=first_s, end_s=first_s + 0.1, labels={"x": "y"}))
    return path


def test_scans_before_a_trigger_at_zero_keep_their_distances_in_a_bag(tmp_path):
    """ROS knows no time before 1970: half of an import from −0.5 s on was stamped zero."""
    write_bags([_array_from(tmp_path / "a.mcap", -0.5)], tmp_path / "bags")
    text = (tmp_path / "bags/a/metadata.yaml").read_text()
    about = json.loads(text)["rosbag2_bagfile_information"]
    assert about["duration"]["nanoseconds"] == 990_000_000
    assert about["starting_time"]["nanoseconds_since_epoch"] == 500_000_000


def test_scans_after_the_end_of_ros_time_are_refused(tmp_path):
    with pytest.raises(BadDataset, match=r"before 2038.* got one of 3000000000 s since 1970"):
        write_bags([_array_from(tmp_path / "a.mcap", 3e9)], tmp_path / "bags")
    assert not (tmp_path / "bags").exists()


def test_parquet_holds_what_was_recorded(make, tmp_path):
    """Every scan, flag, image and mark; units beside the columns; the manifest in the file."""
    pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (taxel[export])")
    from taxel.exchange.parquet_tables import write_tables

    path = make(tmp_path / "a.mcap")
    found = write_tables([path], tmp_path / "tables")
    assert found == {"a": {"scans": 1600, "frames": 80, "marks": 2}}
    ours = read_recording(path)
    scans = pq.read_table(tmp_path / "tables/a.scans.parquet")
    np.testing.assert_array_equal(scans["index"].to_numpy(), ours.samples.values[:, 1])
    np.testing.assert_array_equal(scans["index validity"].to_numpy(), ours.samples.validity[:, 1])
    np.testing.assert_array_equal(scans["arrival_s"].to_numpy(), ours.samples.arrival_s)
    assert scans.schema.field("palm").metadata == {b"unit": b"V"}
    assert json.loads(json.loads(scans.schema.metadata[b"taxel"])["labels"]) == {"shape": "sphere"}
    frames = pq.read_table(tmp_path / "tables/a.frames.parquet").to_pylist()
    left = [row["image"] for row in frames if row["camera"] == "left"]
    assert left == [frame.jpeg for frame in iterate_frames(path, 0)]
    marks = pq.read_table(tmp_path / "tables/a.marks.parquet").to_pylist()
    assert marks[0]["groups"] == [("cup", "ä")]


def test_parquet_has_no_two_columns_of_one_name(make, tmp_path):
    """pandas, Polars and Arrow refuse to read such a table."""
    pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (taxel[export])")
    from taxel.exchange.parquet_tables import write_tables

    path = make(tmp_path / "a.mcap", cameras=False, channels=("counter", "x", "x validity"))
    write_tables([path], tmp_path / "tables")
    scans = pq.read_table(tmp_path / "tables/a.scans.parquet")
    ours = read_recording(path).samples
    np.testing.assert_array_equal(scans["counter"].to_numpy(), ours.counter)
    np.testing.assert_array_equal(scans["counter (channel)"].to_numpy(), ours.values[:, 0])
    np.testing.assert_array_equal(scans["x validity"].to_numpy(), ours.validity[:, 1])
    np.testing.assert_array_equal(scans["x validity (channel)"].to_numpy(), ours.values[:, 2])


def test_parquets_manifests_are_utf_8_whatever_the_locale(make, tmp_path):
    pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (taxel[export])")
    manifest = read_manifest(make(tmp_path / "first.mcap", cameras=False))
    with Recorder(tmp_path / "a.mcap", replace(manifest, labels={"object": "Kürbis"})):
        pass
    code = (
        "from pathlib import Path; from taxel.exchange.parquet_tables import write_tables; "
        "write_tables([Path('a.mcap')], Path('tables'))"
    )
    own = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, **own},
                          capture_output=True, timeout=60, check=False)  # fmt: skip

    assert done.returncode == 0, done.stderr
    assert "Kürbis" in (tmp_path / "tables/manifests.json").read_text(encoding="utf-8")


def test_motion_jpeg_is_the_cameras_own_bytes_at_their_times(make, tmp_path):
    av = pytest.importorskip("av", reason="av is not installed (taxel[export])")
    from taxel.exchange.video_files import write_videos

    path = make(tmp_path / "a.mcap")
    assert write_videos([path], tmp_path / "v") == {"a.left.mkv": 40, "a.right.mkv": 40}
    frames = list(iterate_frames(path, 1))
    with av.open(str(tmp_path / "v/a.right.mkv")) as file:
        packets = [packet for packet in file.demux() if packet.size]
        assert [bytes(packet) for packet in packets] == [frame.jpeg for frame in frames]
        taken = [float(packet.pts * packet.time_base) for packet in packets]
    since = [frame.fitted_s - frames[0].fitted_s for frame in frames]
    np.testing.assert_allclose(taken, since, atol=0.001)


def test_h264_is_for_looking(make, tmp_path):
    av = pytest.importorskip("av", reason="av is not installed (taxel[export])")
    if "libx264" not in av.codecs_available:
        pytest.skip("this build of av has no H.264 encoder")
    from taxel.exchange.video_files import write_videos

    path = make(tmp_path / "a.mcap", array=False)
    assert write_videos([path], tmp_path / "v", codec="h264") == {
        "a.left.mp4": 40,
        "a.right.mp4": 40,
    }
    with av.open(str(tmp_path / "v/a.left.mp4")) as file:
        assert sum(1 for _ in file.decode(video=0)) == 40


@pytest.mark.parametrize("codec", ["mjpeg", "h264"])
def test_a_folder_may_be_called_by_the_time_of_day(make, tmp_path, monkeypatch, codec):
    """FFmpeg takes what stands before a colon for a protocol."""
    av = pytest.importorskip("av", reason="av is not installed (taxel[export])")
    if codec == "h264" and "libx264" not in av.codecs_available:
        pytest.skip("this build of av has no H.264 encoder")
    from taxel.exchange.video_files import write_videos

    path = make(tmp_path / "a.mcap", array=False)
    monkeypatch.chdir(tmp_path)

    assert list(write_videos([path], Path("10:30"), codec=codec).values()) == [40, 40]


def test_a_recording_without_cameras_has_no_video(make, tmp_path):
    pytest.importorskip("av", reason="av is not installed (taxel[export])")
    from taxel.exchange.video_files import write_videos

    with pytest.raises(BadDataset, match="cameras"):
        write_videos([make(tmp_path / "a.mcap", cameras=False)], tmp_path / "v")
    assert not (tmp_path / "v").exists()


@pytest.mark.parametrize(("codec", "ending"), [("mjpeg", "mkv"), ("h264", "mp4")])
def test_cameras_of_odd_sizes_and_like_names_have_a_video_each(tmp_path, codec, ending):
    av = pytest.importorskip("av", reason="av is not installed (taxel[export])")
    if codec == "h264" and "libx264" not in av.codecs_available:
        pytest.skip("this build of av has no H.264 encoder")
    from taxel.exchange.video_files import write_videos

    cameras = tuple(
        CameraInfo(name=name, width=33, height=25, rate_hz=25.0) for name in ("l 1", "l_1")
    )
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=NO_ARRAY, cameras=cameras)) as recorder:
        for number in range(12):
            for camera in range(2):
                image = np.full((25, 33, 3), 40 + 100 * camera, np.uint8)
                recorder.frame(Frame(camera=camera, jpeg=encode_jpeg(image), counter=number,
                                     device_s=float("nan"), arrival_s=number / 25,
                                     fitted_s=number / 25))  # fmt: skip
    found = write_videos([tmp_path / "a.mcap"], tmp_path / "v", codec=codec)
    assert found == {f"a.l_1-1.{ending}": 12, f"a.l_1-2.{ending}": 12}
    for number, level in ((1, 40), (2, 140)):
        with av.open(str(tmp_path / "v" / f"a.l_1-{number}.{ending}")) as file:
            images = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
        assert [image.shape for image in images] == [(25, 33, 3)] * 12
        assert abs(int(images[5].mean()) - level) <= 2


def test_a_frame_of_another_size_is_in_no_video(tmp_path):
    """It was copied into a file that declares one size: players drew it askew or gave up."""
    pytest.importorskip("av", reason="av is not installed (taxel[export])")
    from taxel.exchange.video_files import write_videos

    camera = CameraInfo(name="left", width=32, height=24, rate_hz=25.0)
    small, large = (encode_jpeg(np.zeros(size, np.uint8)) for size in ((24, 32, 3), (48, 64, 3)))
    for name, second in (("cut", small[:-9]), ("mixed", large)):
        path = tmp_path / f"{name}.mcap"
        with Recorder(path, Manifest(sensor=NO_ARRAY, cameras=(camera,))) as recorder:
            for number, jpeg in enumerate((small, second)):
                recorder.frame(Frame(camera=0, jpeg=jpeg, counter=number, device_s=0.0,
                                     arrival_s=number / 25, fitted_s=number / 25))  # fmt: skip
    assert write_videos([tmp_path / "cut.mcap"], tmp_path / "cut") == {"cut.left.mkv": 2}
    with pytest.raises(BadDataset, match=r"frames of 32×24 from left; got one of 64×48 in .*mixed"):
        write_videos([path], tmp_path / "v")
    assert not (tmp_path / "v").exists()


def test_a_camera_that_is_called_like_anothers_video_keeps_its_own(tmp_path):
    """Two cameras wrote one file: the images of the first were lost."""
    pytest.importorskip("av", reason="av is not installed (taxel[export])")
    from taxel.exchange.video_files import write_videos

    names = ("l 1", "l_1", "l_1-1")
    cameras = tuple(CameraInfo(name=name, width=32, height=24, rate_hz=25.0) for name in names)
    jpeg = encode_jpeg(np.zeros((24, 32, 3), np.uint8))
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=NO_ARRAY, cameras=cameras)) as recorder:
        for camera, frames in enumerate((3, 4, 5)):
            for number in range(frames):
                recorder.frame(Frame(camera=camera, jpeg=jpeg, counter=number, device_s=0.0,
                                     arrival_s=number / 25, fitted_s=number / 25))  # fmt: skip
    found = write_videos([tmp_path / "a.mcap"], tmp_path / "v")
    assert found == {"a.l_1-1-1.mkv": 3, "a.l_1-2.mkv": 4, "a.l_1-1.mkv": 5}
    assert sorted(found) == sorted(path.name for path in (tmp_path / "v").glob("*.mkv"))


def test_a_video_of_a_camera_that_runs_fast_is_read_to_its_last_frame(tmp_path):
    """Matroska says how long it lasts, not how many frames it holds."""
    pytest.importorskip("av", reason="av is not installed (taxel[export])")
    from taxel.exchange.video_files import write_videos
    from taxel.recordings.imports.footage import Video

    camera = CameraInfo(name="left", width=32, height=24, rate_hz=25.0)
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=NO_ARRAY, cameras=(camera,))) as recorder:
        for number in range(60):
            image = np.full((24, 32, 3), 40 + 3 * number, np.uint8)
            recorder.frame(Frame(camera=0, jpeg=encode_jpeg(image), counter=number,
                                 device_s=float("nan"), arrival_s=number / 27,
                                 fitted_s=number / 27))  # fmt: skip
    write_videos([tmp_path / "a.mcap"], tmp_path / "v")
    video = Video(tmp_path / "v" / "a.left.mkv")
    levels = [float(image.mean()) for image in video.frames()]
    np.testing.assert_allclose(levels, 40 + 3 * np.arange(60), atol=2)
    assert video.count == 60


def test_h264_takes_frames_that_come_together_or_late(tmp_path):
    """Two in one sixtieth of a second had the same time for the encoder, which gave up."""
    av = pytest.importorskip("av", reason="av is not installed (taxel[export])")
    if "libx264" not in av.codecs_available:
        pytest.skip("this build of av has no H.264 encoder")
    from taxel.exchange.video_files import write_videos

    times = np.sort(np.arange(60) / 60 + np.random.default_rng(0).normal(0, 0.01, 60))
    camera = CameraInfo(name="left", width=32, height=24, rate_hz=60.0)
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=NO_ARRAY, cameras=(camera,))) as recorder:
        for number, time_s in enumerate(times):
            image = encode_jpeg(np.full((24, 32, 3), 40 + number, np.uint8))
            recorder.frame(Frame(camera=0, jpeg=image, counter=number, device_s=float("nan"),
                                 arrival_s=time_s, fitted_s=time_s))  # fmt: skip
    write_videos([tmp_path / "a.mcap"], tmp_path / "v", codec="h264")
    with av.open(str(tmp_path / "v" / "a.left.mp4")) as file:
        found = [float(frame.pts * frame.time_base) for frame in file.decode(video=0)]
    np.testing.assert_allclose(np.diff(found), np.diff(times), atol=1e-4)
