"""Claims about exports of a camera that looks on: colour everywhere, depth where 16 bits fit."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.exchange.ros2_bag import write_bags
from taxel.frame_codec import decode_depth
from taxel.recordings.reader import iterate_frames, read_manifest


@pytest.fixture(scope="module")
def recording(make, tmp_path_factory) -> Path:
    """An array, two tactile cameras, colour and depth of a scene."""
    return make(tmp_path_factory.mktemp("r") / "a.mcap", scene=("scene", "scene-depth"))


def images(path: Path, camera: int) -> list[bytes]:
    return [frame.jpeg for frame in iterate_frames(path, camera)]


def test_a_bag_passes_depth_and_colour_through(recording, tmp_path):
    """The bytes of both, each under its own format; decoded, depth keeps its 16 bits."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    typesys = pytest.importorskip("rosbags.typesys")
    counts = write_bags([recording], tmp_path / "bags")["a"]
    assert counts["/camera/scene"] == counts["/camera/scene_depth"] == 48
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for camera, topic, form in ((2, "/camera/scene", "jpeg"), (3, "/camera/scene_depth", "png")):
        with rosbag2.Reader(tmp_path / "bags/a") as reader:
            wanted = [c for c in reader.connections if c.topic == topic]
            found = [store.deserialize_cdr(content, connection.msgtype)
                     for connection, _, content in reader.messages(wanted)]  # fmt: skip
        assert {message.format for message in found} == {form}
        assert [bytes(message.data) for message in found] == images(recording, camera)
    info = read_manifest(recording).cameras[3]
    np.testing.assert_array_equal(decode_depth(bytes(found[7].data), info), 60_007)


def test_tables_hold_depth_and_say_how_it_is_coded(recording, tmp_path):
    pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (taxel[export])")
    from taxel.exchange.parquet_tables import write_tables

    write_tables([recording], tmp_path / "tables")
    table = pq.read_table(tmp_path / "tables/a.frames.parquet")
    rows = table.to_pylist()
    coding = {row["camera"]: row["coding"] for row in rows}
    assert coding == {"left": "jpeg", "right": "jpeg", "scene": "jpeg", "scene-depth": "png16"}
    depth = [row["image"] for row in rows if row["camera"] == "scene-depth"]
    assert depth == images(recording, 3)
    cameras = json.loads(json.loads(table.schema.metadata[b"taxel"])["cameras"])
    assert cameras[3]["details"]["depth_unit_m"] == "0.001"


def test_a_data_set_holds_colour_and_leaves_depth_out_in_one_line(recording, tmp_path, capsys):
    """Back again: both tactile cameras byte by byte, and the scene's frames that were nearest."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")
    main(["export", "lerobot", str(recording), "--output", str(tmp_path / "set")])
    printed = capsys.readouterr().out.splitlines()
    assert sum("left out: scene-depth: depth has 16 bits" in line for line in printed) == 1
    main(["import", "lerobot", "--data", str(tmp_path / "set"), "--output", str(tmp_path / "b")])
    back = tmp_path / "b/a.mcap"
    after = read_manifest(back)
    assert [camera.name for camera in after.cameras] == ["left", "right", "scene"]
    assert [camera.name for camera in after.tactile] == ["left", "right"]
    assert [images(back, 0), images(back, 1)] == [images(recording, 0), images(recording, 1)]
    scene = images(back, 2)
    assert len(scene) > 35
    assert set(scene) <= set(images(recording, 2))


def test_depth_does_not_make_a_recording_another_kind(recording, make, tmp_path):
    """What is left out may be missing from some recordings of a data set."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")
    from taxel.exchange.lerobot_write import write_lerobot

    other = make(tmp_path / "b.mcap", scene=("scene",), seed=1)
    assert write_lerobot([recording, other], tmp_path / "set").episodes == 2


def test_videos_hold_colour_and_leave_depth_out_in_one_line(recording, tmp_path, capsys):
    av = pytest.importorskip("av", reason="av is not installed (taxel[export])")
    main(["export", "video", str(recording), "--output", str(tmp_path / "v")])
    printed = capsys.readouterr().out.splitlines()
    assert sum("left out: scene-depth" in line for line in printed) == 1
    made = sorted(path.name for path in (tmp_path / "v").glob("*.mkv"))
    assert made == ["a.left.mkv", "a.right.mkv", "a.scene.mkv"]
    with av.open(str(tmp_path / "v/a.scene.mkv")) as file:
        packets = [bytes(packet) for packet in file.demux() if packet.size]
    assert packets == images(recording, 2)


@pytest.mark.parametrize("kind", ["lerobot", "video"])
def test_depth_alone_is_refused_in_one_line(kind, make, tmp_path, capsys):
    """No trace, and nothing half-written."""
    pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")
    pytest.importorskip("av", reason="av is not installed (taxel[export])")
    path = make(tmp_path / "a.mcap", array=False, cameras=False, scene=("scene-depth",))
    with pytest.raises(SystemExit) as stopped:
        main(["export", kind, str(path), "--output", str(tmp_path / "o")])
    assert stopped.value.code == 2
    assert "\n" not in capsys.readouterr().err.strip()
    assert not (tmp_path / "o").exists()
