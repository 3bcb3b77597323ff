"""Claims about what other programs see: the file is plain MCAP with plain CDR messages."""

import json
import struct

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from taxel.recordings.reader import read_recording


def decode_cdr(content: bytes) -> dict[str, object]:
    """Decode a Scan as any ROS 2 program would, knowing only its schema."""
    assert content[:4] == b"\x00\x01\x00\x00"
    body, at = content[4:], 0

    def take(form: str, size: int, count: int = 1):
        nonlocal at
        at += -at % size
        found = struct.unpack_from(f"<{count}{form}", body, at)
        at += size * count
        return found

    scan: dict[str, object] = {}
    for name in ("fitted_s", "device_s", "arrival_s"):
        scan[name] = take("d", 8)[0]
    scan["counter"] = take("q", 8)[0]
    scan["values"] = take("f", 4, take("I", 4)[0])
    scan["validity"] = take("B", 1, take("I", 4)[0])
    assert at == len(body)
    return scan


def test_the_mcap_package_reads_every_scan_with_its_checks_on(finished, manifest):
    """The indexed reader, with CRC validation, yields each scan; the schema decodes it."""
    ours = read_recording(finished).samples
    with finished.open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages(topics=["/touch/teng"]))
    assert len(messages) == len(ours) == 120
    for i, (schema, channel, message) in enumerate(messages):
        scan = decode_cdr(message.data)
        assert (schema.name, schema.encoding) == ("taxel_msgs/msg/Scan", "ros2msg")
        assert channel.message_encoding == "cdr"
        assert message.sequence == i
        assert scan["fitted_s"] == ours.fitted_s[i]
        assert scan["arrival_s"] == ours.arrival_s[i]
        assert scan["device_s"] == ours.device_s[i]
        assert scan["counter"] == ours.counter[i]
        assert scan["values"] == tuple(ours.values[i])
        assert scan["validity"] == tuple(ours.validity[i])
        assert message.log_time == manifest.wall_anchor_ns + round(ours.fitted_s[i] * 1e9)
        assert message.publish_time == manifest.wall_anchor_ns + round(ours.arrival_s[i] * 1e9)


def test_the_schema_lists_the_fields_in_the_order_of_the_bytes(finished):
    """A program that compiles the schema finds what the decoder of this test found."""
    with finished.open("rb") as file:
        schema = next(iter(make_reader(file).get_summary().schemas.values()))
    fields = [line.split()[:2] for line in schema.data.decode().splitlines() if line[0] != "#"]
    assert fields == [
        ["float64", "fitted_s"],
        ["float64", "device_s"],
        ["float64", "arrival_s"],
        ["int64", "counter"],
        ["float32[]", "values"],
        ["uint8[]", "validity"],
    ]


def test_marks_are_json_with_a_json_schema(finished):
    """A mark can be read without taxel."""
    with finished.open("rb") as file:
        ((schema, channel, message),) = make_reader(file).iter_messages(topics=["/marks"])
    assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
    required = json.loads(schema.data)["required"]
    assert sorted(json.loads(message.data)) == sorted(required)


def test_the_summary_counts_what_the_data_hold(finished):
    """Statistics, indexes and metadata agree with a walk through the file."""
    with finished.open("rb") as file:
        summary = make_reader(file).get_summary()
    with finished.open("rb") as file:
        walked = list(StreamReader(file, validate_crcs=True).records)
    kinds = [type(record).__name__ for record in walked]
    assert summary.statistics.message_count == 121 == kinds.count("Message")
    assert summary.statistics.chunk_count == len(summary.chunk_indexes) == 7
    assert summary.statistics.channel_message_counts == {1: 120, 2: 1}
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
            decode_cdr(message.data)["counter"]
            for _, _, message in reader.iter_messages(
                topics=["/touch/teng"], start_time=everything[30], end_time=everything[50]
            )
        ]
    np.testing.assert_array_equal(part, ours.counter[30:50])


@pytest.mark.parametrize("channels", [1, 2, 3, 5, 12, 69])
def test_any_number_of_channels_is_laid_out_right(channels, numbered):
    """The alignment of CDR holds for odd and even counts alike."""
    from taxel.recordings.scan_layout import encode_scans

    samples = numbered(3, 2, channels)
    record = encode_scans(samples, 0, 0)[1].tobytes()
    scan = decode_cdr(record[9 + 22 :])
    assert scan["values"] == tuple(samples.values[1])
    assert scan["counter"] == 4
