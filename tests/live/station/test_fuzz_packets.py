"""Bytes in a ring from a process that went astray, and wishes of a page that did."""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from taxel.live.station.packets import pack, unpack
from taxel.live.station.page_requests import fulfil
from taxel.signals import Frame, Mark, Samples

pytestmark = pytest.mark.data
FUZZ = settings(settings.get_profile("fuzz"))
any_json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner),
    max_leaves=12,
)
contents = (
    st.binary(max_size=200)
    | st.builds(lambda kind, rest: kind + rest, st.sampled_from([b"S", b"F", b"M", b"N"]),
                st.binary(max_size=200))
    | st.builds(lambda n, channels, rest: b"S\0\0\0" + n.to_bytes(4, "little")
                + channels.to_bytes(4, "little") + rest,
                st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1), st.binary(max_size=200))
    | st.builds(lambda value: b"N" + json.dumps(value).encode(), any_json)
)  # fmt: skip


@FUZZ
@given(contents)
@example(b"S\0\0\0" + b"\xff" * 8)
@example(b"N" + b"[" * 3000)
@example(b"M" + b'{"a":' * 3000)
@example(b"N" + b"9" * 5000)
def test_any_bytes_are_a_packet_or_none(content: bytes):
    try:
        packet = unpack(content)
    except ValueError:
        return
    if isinstance(packet, Samples | Frame | Mark):
        pack(packet)


requests = any_json | st.fixed_dictionaries(
    {"do": st.sampled_from(["acknowledge", "record", "end", "arm", ""]) | any_json},
    optional={"labels": any_json | st.dictionaries(st.text(max_size=9), any_json),
              "path": st.text(max_size=20), "seen": any_json | st.lists(st.integers())},
)  # fmt: skip


@FUZZ
@given(requests)
@example({"do": "record", "labels": {"../../x": "/etc"}, "path": "/etc/passwd"})
def test_any_request_of_a_page_is_one_of_three_or_is_refused(request: object):
    """It never says where to record, and nothing else than these is reached."""
    done: list[object] = []

    def record(path: Path, labels: dict[str, str], groups: dict[str, str]) -> None:
        assert path.parent == Path("recordings")
        assert all(isinstance(text, str) for text in (*labels, *labels.values()))
        done.append("record")

    station = SimpleNamespace(
        acknowledge=lambda seen: done.append("acknowledge"),
        end_recording=lambda: done.append("end"),
        record=record,
        config=SimpleNamespace(groups={"session": "1"}, labels={}, recordings=Path("recordings")),
    )
    try:
        fulfil(station, unpack(pack(request)))  # type: ignore[arg-type]
    except (ValueError, KeyError, TypeError):  # as the station expects, and counts
        assert done == []
    assert len(done) <= 1
    if done:
        assert isinstance(request, dict)
        assert request["do"] == done[0]
