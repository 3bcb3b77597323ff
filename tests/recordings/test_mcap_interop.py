"""Claims about what other programs see: MCAP of profile ros2, decoded by their own packages."""

import importlib.util
import json
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_frames, iterate_slips, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo, SlipNote

TYPES = {
    "/touch/teng": "taxel_msgs/msg/Scan",
    "/marks": "taxel_msgs/msg/Mark",
    "/camera/left": "sensor_msgs/msg/CompressedImage",
    "/camera/right": "sensor_msgs/msg/CompressedImage",
    "/camera/left/times": "taxel_msgs/msg/FrameTimes",
    "/camera/right/times": "taxel_msgs/msg/FrameTimes",
    "/slip": "taxel_msgs/msg/Slip",
}
"""Topic → type of a full recording; a scan's name ends in a digest of its fields."""
CHANNELS, UNITS = ("Thumb-1", "index/1", "7", "class"), ("V", "µm", "°", "")
FIELDS = ("thumb_1_v", "index_per_1_um", "channel_7_deg", "class_value")
SCANS, FRAMES = 200, 5


def frame(camera: int, number: int) -> Frame:
    jpeg = b"\xff\xd8" + np.random.default_rng(2 * number + camera).bytes(300 + number)
    return Frame(camera=camera, jpeg=jpeg + b"\xff\xd9", counter=number, device_s=number / 25,
                 arrival_s=50.01 + number / 25, fitted_s=50.0 + number / 25)  # fmt: skip


def full_recording(path: Path) -> Path:
    """Everything that a recording can hold: scans, frames of two cameras, a mark, slip."""
    number = np.arange(SCANS)
    time_s = 50.0 + number / 1000.0
    validity = np.zeros((SCANS, 4), np.uint8)
    validity[7, 2] = 1
    samples = Samples(
        values=np.random.default_rng(0).random((SCANS, 4)).astype(np.float32),
        counter=number.astype(np.int64), device_s=time_s - 49, arrival_s=time_s + 0.002,
        fitted_s=time_s, validity=validity,
    )  # fmt: skip
    sensor = SensorInfo(name="teng", channels=CHANNELS, units=UNITS, rate_hz=1000.0)
    cameras = tuple(
        CameraInfo(name=name, width=32, height=24, rate_hz=25.0) for name in ("left", "right")
    )
    manifest = Manifest(sensor=sensor, cameras=cameras, wall_anchor_ns=1_700_000_000_000_000_000)
    with Recorder(path, manifest) as recorder:
        recorder.write(samples)
        for i in range(FRAMES):
            recorder.frame(frame(0, i))
            recorder.frame(frame(1, i))
        recorder.mark(Mark(start_s=50.0, end_s=50.1, labels={"grasp": "ü"}, groups={"cup": "1"}))
        values = {"slip_mm": 0.25, "slip_rate_mm_s": None, "slip_seen": True}
        recorder.slip(SlipNote(time_s=50.04, who="monitor/0", values=values))
    return path


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return full_recording(tmp_path_factory.mktemp("full") / "full.mcap")


def check_scan(message: SimpleNamespace, i: int, ours: Samples) -> None:
    """A scan decoded by another program is ours, bit by bit, each channel under its name."""
    assert (message.fitted_s, message.device_s) == (ours.fitted_s[i], ours.device_s[i])
    assert (message.arrival_s, message.counter) == (ours.arrival_s[i], ours.counter[i])
    assert [getattr(message.values, name) for name in FIELDS] == ours.values[i].tolist()
    assert bytes(message.validity) == ours.validity[i].tobytes()


def check_all(messages: list[tuple[str, object]], full: Path) -> None:
    """All that another program decoded is what taxel reads: scans, images, times, mark, slip."""
    found: dict[str, list] = {topic: [] for topic in TYPES}
    for topic, message in messages:
        found[topic].append(message)
    ours = read_recording(full)
    assert len(found["/touch/teng"]) == SCANS
    for i, scan in enumerate(found["/touch/teng"]):
        check_scan(scan, i, ours.samples)
    for camera, name in enumerate(("left", "right")):
        frames = list(iterate_frames(full, camera))
        for kept, image, times in zip(
            frames, found[f"/camera/{name}"], found[f"/camera/{name}/times"], strict=True
        ):
            assert bytes(image.data) == kept.jpeg
            assert (image.header.frame_id, image.format) == (name, "jpeg")
            stamp = image.header.stamp
            assert stamp.sec + stamp.nanosec / 1e9 == pytest.approx(1.7e9 + kept.fitted_s)
            assert (times.fitted_s, times.counter) == (kept.fitted_s, kept.counter)
    (mark,), (slip,) = found["/marks"], found["/slip"]
    assert (mark.start_s, mark.labels[0].key, mark.labels[0].value) == (50.0, "grasp", "ü")
    assert (slip.slip_mm, slip.slip_seen, slip.who) == (0.25, True, "monitor/0")
    assert np.isnan(slip.slip_rate_mm_s)


def test_the_mcap_package_reads_every_message_with_its_checks_on(full):
    """The indexed reader, with CRC validation; every channel is CDR with a ros2msg schema."""
    ours = read_recording(full).samples
    with full.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        messages = list(reader.iter_messages())
    types = {channel.topic: schema.name for schema, channel, _ in messages}
    types["/touch/teng"] = types["/touch/teng"][:-8]
    assert types == TYPES
    assert {(schema.encoding, channel.message_encoding) for schema, channel, _ in messages} == {
        ("ros2msg", "cdr")
    }
    scans = [message for _, channel, message in messages if channel.topic == "/touch/teng"]
    for i, message in enumerate(scans):
        assert message.sequence == i
        assert message.log_time == 1_700_000_000_000_000_000 + round(ours.fitted_s[i] * 1e9)
        assert message.publish_time == 1_700_000_000_000_000_000 + round(ours.arrival_s[i] * 1e9)


def test_every_image_of_a_camera_has_the_same_frame_id(full):
    """A viewer keeps a place for each frame_id that it has ever seen."""
    with full.open("rb") as file:
        messages = list(make_reader(file).iter_messages(topics=["/camera/left"]))
    assert len(messages) == FRAMES
    assert {bytes(message.data[12:28]) for _, _, message in messages} == {
        b"\5\0\0\0left\0\0\0\0\5\0\0\0"
    }


def test_mcap_ros2_support_decodes_every_message(full):
    """Foxglove's own decoder for Python."""
    ros2 = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is not installed")
    with full.open("rb") as file:
        reader = make_reader(file, decoder_factories=[ros2.DecoderFactory()])
        decoded = [(c.topic, message) for _, c, _, message in reader.iter_decoded_messages()]
    check_all(decoded, full)


def test_rosbags_decodes_every_message(full):
    """The reader of ROS 2 bags without ROS."""
    highlevel = pytest.importorskip("rosbags.highlevel", reason="rosbags is not installed")
    with highlevel.AnyReader([full]) as reader:
        decoded = [
            (connection.topic, reader.deserialize(content, connection.msgtype))
            for connection, _, content in reader.messages()
        ]
    check_all(decoded, full)


def test_recordings_of_different_arrays_are_read_beside_each_other(full, tmp_path):
    """ROS knows one definition a name: a scan's name says which channels it has."""
    highlevel = pytest.importorskip("rosbags.highlevel", reason="rosbags is not installed")
    sensor = SensorInfo(name="teng", channels=("other",), units=("N",), rate_hz=10.0)
    with Recorder(tmp_path / "other.mcap", Manifest(sensor=sensor)) as recorder:
        recorder.write(Samples.from_values(np.ones((3, 1)), np.arange(3) / 10))
    with highlevel.AnyReader([full, tmp_path / "other.mcap"]) as reader:
        assert len(list(reader.messages())) == SCANS + 4 * FRAMES + 2 + 3


FOXGLOVE = """
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const rows = JSON.parse(require("fs").readFileSync(0));
const readers = {};
const plain = (key, value) => typeof value === "bigint" ? Number(value)
    : ArrayBuffer.isView(value) ? Buffer.from(value.buffer, value.byteOffset, value.byteLength)
        .toString("base64") : value;
console.log(JSON.stringify(rows.map(([topic, schema, data]) => {
    readers[topic] ??= new MessageReader(parse(schema, { ros2: true }));
    return [topic, readers[topic].readMessage(Buffer.from(data, "base64"))];
}), plain));
"""


def test_foxgloves_own_decoder_reads_every_topic(full):
    """@foxglove/rosmsg2-serialization, what the viewer itself uses, under node."""
    import base64

    if not _has_foxglove():
        pytest.skip("node with @foxglove/rosmsg2-serialization is not installed (NODE_PATH)")
    with full.open("rb") as file:
        rows = [
            (c.topic, s.data.decode(), base64.b64encode(m.data).decode())
            for s, c, m in make_reader(file).iter_messages()
        ]
    run = subprocess.run(["node", "-e", FOXGLOVE], input=json.dumps(rows), capture_output=True,
                         text=True, check=True)  # fmt: skip
    found = dict(json.loads(run.stdout))  # the last of each topic
    ours = read_recording(full).samples
    assert list(found["/touch/teng"]["values"]) == list(FIELDS)
    assert list(found["/touch/teng"]["values"].values()) == ours.values[-1].tolist()
    assert found["/camera/right"]["header"]["frame_id"] == "right"
    assert base64.b64decode(found["/camera/right"]["data"]) == frame(1, FRAMES - 1).jpeg
    assert found["/marks"]["labels"] == [{"key": "grasp", "value": "ü"}]
    assert found["/slip"]["slip_mm"] == 0.25


def _has_foxglove() -> bool:
    if shutil.which("node") is None:
        return False
    ask = "require('@foxglove/rosmsg'), require('@foxglove/rosmsg2-serialization')"
    return subprocess.run(["node", "-e", ask], capture_output=True).returncode == 0


@pytest.mark.skipif(
    importlib.util.find_spec("rerun") is None,
    reason="rerun-sdk is not installed (764 MB; pip install 'taxel[rerun]')",
)
def test_rerun_shows_images_as_images_and_channels_by_name(full, tmp_path):
    """Rerun's own importer of MCAP makes images of the frames and columns of the channels."""
    import rerun

    save = tmp_path / "full.rrd"
    with rerun.RecordingStream("taxel_test") as stream:
        stream.save(save)
        stream.log_file_from_path(full)
        stream.flush()
    content = save.read_bytes()
    for sign in (b"EncodedImage", b"/camera/left", b"thumb_1_v"):
        assert sign in content, sign


def test_the_summary_counts_what_the_data_hold(full):
    """Statistics, indexes and metadata agree with a walk through the file."""
    with full.open("rb") as file:
        summary = make_reader(file).get_summary()
    with full.open("rb") as file:
        walked = list(StreamReader(file, validate_crcs=True).records)
    kinds = [type(record).__name__ for record in walked]
    counts = {1: SCANS, 2: 1, 3: FRAMES, 4: FRAMES, 5: FRAMES, 6: FRAMES, 7: 1}
    assert summary.statistics.message_count == sum(counts.values()) == kinds.count("Message")
    assert summary.statistics.chunk_count == len(summary.chunk_indexes)
    assert summary.statistics.channel_message_counts == counts
    assert [index.name for index in summary.metadata_indexes] == ["taxel", "taxel.statistics"]
    assert kinds[:2] == ["Header", "Metadata"]


@pytest.mark.filterwarnings("ignore:(start|end)_time is deprecated")  # mcap 1.3 knows no other
def test_messages_can_be_sought_by_time(finished):
    """The chunk and message indexes point at the right bytes."""
    ours = read_recording(finished).samples
    with finished.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        everything = [m.log_time for _, _, m in reader.iter_messages(topics=["/touch/teng"])]
        part = [
            int.from_bytes(message.data[28:36], "little")
            for _, _, message in reader.iter_messages(
                topics=["/touch/teng"], start_time=everything[30], end_time=everything[50]
            )
        ]
    np.testing.assert_array_equal(part, ours.counter[30:50])


@pytest.mark.parametrize("channels", [1, 2, 3, 5, 12, 69, 1001])
def test_any_number_of_channels_is_laid_out_right(channels, numbered, tmp_path):
    """The alignment of CDR holds for odd and even counts alike, and for one field of many."""
    ros2 = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is not installed")
    names = tuple(f"s{i}" for i in range(channels))
    sensor = SensorInfo(name="x", channels=names, units=("V",) * channels, rate_hz=1000.0)
    samples = numbered(3, 2, channels)
    with Recorder(tmp_path / "a.mcap", Manifest(sensor=sensor)) as recorder:
        recorder.write(samples)
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[ros2.DecoderFactory()])
        _, scan = [message for _, _, _, message in reader.iter_decoded_messages()]
    many = channels > 1000
    values = list(scan.values.channels) if many else [getattr(scan.values, f"{n}_v") for n in names]
    assert values == samples.values[1].tolist()
    assert (scan.counter, len(scan.validity)) == (4, channels)


def test_slip_is_read_back(full):
    (note,) = iterate_slips(full)
    assert note.values["slip_mm"] == 0.25
    assert note.values["slip_rate_mm_s"] is None
