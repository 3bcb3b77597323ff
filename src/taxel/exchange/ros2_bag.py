"""Recordings as ROS 2 bags: what `ros2 bag info` and `ros2 bag play` take, and rosbags reads.

Images are sensor_msgs/CompressedImage, marks and slip std_msgs/String with JSON: types that every
ROS 2 has. Touch is taxel_msgs/TactileState, for ROS 2 has no message of touch; its package is
written beside, to be built with colcon. Knows nothing about nodes or networks.

Source of the layout: ros2/rosbag2, docs of metadata.yaml, version 5. Background:
docs/decisions/0051.
"""

from __future__ import annotations

import json
import math
import re
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from taxel.errors import BadDataset
from taxel.exchange.output import new_tree
from taxel.recordings import frame_layout
from taxel.recordings.cdr import CDR_HEAD, CdrWriter
from taxel.recordings.manifest import Manifest
from taxel.recordings.mark_layout import MARK_TOPIC
from taxel.recordings.messages import definition, wall_ns, wall_ns_of
from taxel.recordings.reader import iterate_blocks, iterate_slips, read_manifest
from taxel.recordings.scan_layout import scan_topic
from taxel.recordings.slip_layout import SLIP_TOPIC
from taxel.signals import Frame, Samples

PACKAGE = "taxel_msgs"
"""Folder of the message's package, beside the bags."""
SIGN = f"{PACKAGE}/package.xml"
_KINDS = (".mcap", "metadata.yaml", "CMakeLists.txt", ".msg")
"""Endings and names of the other files in such a folder."""
STATE_TYPE = f"{PACKAGE}/msg/TactileState"
STATE_FIELDS = """\
# All channels of a touch sensor at one moment. Written by taxel.
std_msgs/Header header  # stamp: when they were read; frame_id: the sensor's name
string[] names          # of the channels
string[] units          # of the channels, such as V
float32[] values        # in these units
uint8[] validity        # 0 good, 1 missing, 2 stale, 4 saturated, 8 reconnecting, 16 not finite
"""
_HEADER = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n")
_TIME = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n")
_TEXT_TYPE = "std_msgs/msg/String"
_STAMP = struct.Struct("<iI")
_LAST_NS = 2**31 * 10**9
"""The first moment that a stamp cannot hold. Source: builtin_interfaces/Time, int32 sec."""
_COUNT = struct.Struct("<I")
_SCHEMAS = {
    STATE_TYPE: definition(STATE_FIELDS, _HEADER, _TIME),
    frame_layout.FRAME_SCHEMA_NAME: frame_layout.FRAME_SCHEMA,
    _TEXT_TYPE: b"string data\n",
}
_FOR_EVER = {"sec": 9223372036, "nsec": 854775807}
_QOS = json.dumps(
    [
        {
            "history": 3, "depth": 0, "reliability": 1, "durability": 2, "deadline": _FOR_EVER,
            "lifespan": _FOR_EVER, "liveliness": 1, "liveliness_lease_duration": _FOR_EVER,
            "avoid_ros_namespace_conventions": False,
        }
    ]
)  # fmt: skip
"""Keep all, reliable, volatile, no deadline: what a recorder that lost nothing offers."""
Message = tuple[str, str, int, int, bytes]
"""Topic, type, log and publish time (ns), CDR."""

_PACKAGE_XML = f"""\
<?xml version="1.0"?>
<package format="3">
  <name>{PACKAGE}</name>
  <version>1.0.0</version>
  <description>Touch as taxel exports it</description>
  <maintainer email="nobody@example.org">taxel</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>std_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
_CMAKE = f"""\
cmake_minimum_required(VERSION 3.8)
project({PACKAGE})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(std_msgs REQUIRED)
rosidl_generate_interfaces(${{PROJECT_NAME}} "msg/TactileState.msg" DEPENDENCIES std_msgs)
ament_package()
"""


def write_bags(
    paths: Sequence[Path],
    output: Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> dict[str, dict[str, int]]:
    """Write a bag for each recording, and the message's package.

    Args:
        paths: The recordings.
        output: Folder to be made.
        overwrite: Replace an older such folder.
        progress: Called with recordings done and in all.

    Returns:
        Bag → topic → messages.

    Raises:
        BadDataset: A scan is of 2038 or later.
        BadRecording: One is damaged or cut short.
        RecordingFailed: The disk refused.
    """
    messages_written = {}
    with new_tree(output, SIGN, _KINDS, overwrite=overwrite) as made:
        _write_package(made / PACKAGE)
        for done, path in enumerate(paths, 1):
            messages_written[path.stem] = _write_bag(path, made / path.stem)
            progress(done, len(paths))
    return messages_written


def _write_package(folder: Path) -> None:
    (folder / "msg").mkdir(parents=True)
    (folder / "package.xml").write_text(_PACKAGE_XML)
    (folder / "CMakeLists.txt").write_text(_CMAKE)
    (folder / "msg/TactileState.msg").write_text(STATE_FIELDS)


def _write_bag(path: Path, folder: Path) -> dict[str, int]:
    folder.mkdir()
    name = f"{path.stem}_0.mcap"
    counts: Counter[str] = Counter()
    types: dict[str, str] = {}
    first_ns, last_ns = None, 0
    with (folder / name).open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start(profile="ros2", library="taxel")
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        names = ros_topics(_topics(read_manifest(path)))
        for recorded, kind, log_ns, publish_ns, body in _messages(path):
            topic = names[recorded]
            if topic not in channels:
                if kind not in schemas:
                    schemas[kind] = writer.register_schema(kind, "ros2msg", _SCHEMAS[kind])
                channels[topic] = writer.register_channel(
                    topic, "cdr", schemas[kind], {"offered_qos_profiles": _QOS}
                )
                types[topic] = kind
            writer.add_message(
                channels[topic], log_ns, body, publish_ns, sequence=counts[topic] % 2**32
            )
            counts[topic] += 1
            first_ns = log_ns if first_ns is None else min(first_ns, log_ns)
            last_ns = max(last_ns, log_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    text = _metadata(name, types, counts, first_ns or 0, last_ns)
    (folder / "metadata.yaml").write_text(text, encoding="utf-8")
    return dict(counts)


def ros_topics(topics: Iterable[str]) -> dict[str, str]:
    """Return topics, each with another name that ROS 2 accepts, whatever their order.

    Those that need no change keep their names.
    """
    names: dict[str, str] = {}
    for topic in sorted(topics, key=lambda own: (ros_topic(own) != own, own)):
        names[topic] = ros_topic(topic, names.values())
    return names


def ros_topic(topic: str, taken: Collection[str] = ()) -> str:
    """Return a topic as ROS 2 accepts it: letters, digits and single underscores, no digit first.

    Source: design.ros2.org, topic and service names.

    Args:
        topic: As recorded, such as /camera/left-2.
        taken: Topics that other names have become.
    """
    parts = [_ros_token(part) for part in topic.split("/") if part]
    name = "/" + "/".join(parts)
    number = 2
    while name in taken:
        name = f"/{'/'.join(parts)}_{number}"
        number += 1
    return name


def _ros_token(part: str) -> str:
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", part):
        return part
    token = re.sub(r"[^A-Za-z0-9]+", "_", part).strip("_")
    return token if token[:1].isalpha() else f"n{token}"


def _metadata(
    name: str, types: dict[str, str], counts: Counter[str], first_ns: int, last_ns: int
) -> str:
    """Return metadata.yaml; JSON is YAML."""
    span = {"nanoseconds": max(0, last_ns - first_ns)}
    start = {"nanoseconds_since_epoch": first_ns}
    total = sum(counts.values())
    topics = [
        {
            "topic_metadata": {
                "name": topic, "type": kind, "serialization_format": "cdr",
                "offered_qos_profiles": _QOS,
            },
            "message_count": counts[topic],
        }
        for topic, kind in types.items()
    ]  # fmt: skip
    about = {
        "version": 5, "storage_identifier": "mcap", "relative_file_paths": [name],
        "duration": span, "starting_time": start, "message_count": total,
        "topics_with_message_count": topics, "compression_format": "", "compression_mode": "",
        "files": [{"path": name, "starting_time": start, "duration": span, "message_count": total}],
    }  # fmt: skip
    return json.dumps({"rosbag2_bagfile_information": about}, indent=1, ensure_ascii=False) + "\n"


def _topics(manifest: Manifest) -> set[str]:
    """Return the topics of all messages that a recording may hold."""
    cameras = {frame_layout.frame_topic(camera.name) for camera in manifest.cameras}
    return {scan_topic(manifest.sensor.name), MARK_TOPIC, SLIP_TOPIC, *cameras}


def _messages(path: Path) -> Iterator[Message]:
    manifest = read_manifest(path)
    if not manifest.wall_anchor_ns:
        manifest = replace(manifest, wall_anchor_ns=_whole_seconds_back_ns(path))
    for block in iterate_blocks(path):
        yield from _scans(block.samples, manifest)
        for frame in block.frames:
            yield _image(frame, manifest)
        for mark in block.marks:
            at_ns = wall_ns_of(mark.start_s, manifest.wall_anchor_ns)
            yield MARK_TOPIC, _TEXT_TYPE, at_ns, at_ns, _text(asdict(mark))
    for note in iterate_slips(path):
        at_ns = wall_ns_of(note.time_s, manifest.wall_anchor_ns)
        yield SLIP_TOPIC, _TEXT_TYPE, at_ns, at_ns, _text(asdict(note))


def _whole_seconds_back_ns(path: Path) -> int:
    """Return how much later the stamps of a recording without wall time must be, nanoseconds.

    ROS knows no time before 1970: scans before a trigger at zero would all have one stamp.
    """
    first_s = 0.0
    for block in iterate_blocks(path):
        times_s = [frame.fitted_s for frame in block.frames] + [m.start_s for m in block.marks]
        first_s = min([first_s, *times_s, *block.samples.fitted_s.tolist()])
    return math.ceil(-first_s) * 10**9


def _scans(samples: Samples, manifest: Manifest) -> Iterator[Message]:
    """Yield scans as TactileState: all but stamp and values is the same in each."""
    sensor = manifest.sensor
    head = CdrWriter()
    head.text(sensor.name)
    for texts in (sensor.channels, sensor.units):
        head.count(len(texts))
        for text in texts:
            head.text(text)
    head.count(len(sensor.channels))  # of the values; puts them on a multiple of four
    same, count = head.content[len(CDR_HEAD) :], _COUNT.pack(len(sensor.channels))
    topic = scan_topic(sensor.name)
    taken = wall_ns(samples.fitted_s, manifest.wall_anchor_ns).tolist()
    if taken and max(taken) >= _LAST_NS:
        raise BadDataset(
            "scans from before 2038, where the time of ROS 2 ends",
            f"one of {max(taken) // 10**9} s since 1970",
            "set the clock of the device; export parquet keeps such times",
        )
    known = np.where(np.isfinite(samples.arrival_s), samples.arrival_s, samples.fitted_s)
    arrived = wall_ns(known, manifest.wall_anchor_ns).tolist()
    for i, (log_ns, publish_ns) in enumerate(zip(taken, arrived, strict=True)):
        stamp = _STAMP.pack(log_ns // 10**9, log_ns % 10**9)
        values = samples.values[i].astype("<f4").tobytes()
        body = b"".join((CDR_HEAD, stamp, same, values, count, samples.validity[i].tobytes()))
        yield topic, STATE_TYPE, log_ns, publish_ns, body


def _image(frame: Frame, manifest: Manifest) -> Message:
    name = manifest.cameras[frame.camera].name
    log_ns, body = frame_layout.image_message(frame, name, manifest.wall_anchor_ns)
    arrival_s = frame.arrival_s if math.isfinite(frame.arrival_s) else frame.fitted_s
    publish_ns = wall_ns_of(arrival_s, manifest.wall_anchor_ns)
    topic = frame_layout.frame_topic(name)
    return topic, frame_layout.FRAME_SCHEMA_NAME, log_ns, publish_ns, b"".join(body)


def _text(value: object) -> bytes:
    body = CdrWriter()
    body.text(json.dumps(value, ensure_ascii=False))
    return body.content
