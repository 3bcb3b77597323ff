"""Foxglove's view of a station: who gets in, what they see, what a slow one misses."""

import json
import socket
import threading
import time

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from taxel.bus.following import STATE, Item
from taxel.bus.foxglove_server import MOST_WAITING, FoxgloveServer
from taxel.bus.foxglove_wire import SUBPROTOCOLS, Channel, Rows, read_request
from taxel.recordings.frame_layout import image_message
from taxel.signals import Frame, Samples

JPEG = b"\xff\xd8 image \xff\xd9"


class OneHand:
    """A station with a hand of two channels."""

    def about(self):
        return {"sources": [{"topic": "/touch/teng", "sensor": {"channels": ("thumb", "index")}}]}


@pytest.fixture
def server():
    with FoxgloveServer(OneHand()) as server:
        yield server


def items(n: int = 10) -> list[Item]:
    """A batch of scans 5 ms apart, a frame and a state."""
    values = np.arange(2.0 * n).reshape(n, 2)
    values[2, 1] = np.nan
    samples = Samples.from_values(values, 1.0 + 0.005 * np.arange(n))
    frame = Frame(camera=0, jpeg=JPEG, counter=3, device_s=0.0, arrival_s=1.0, fitted_s=1.0)
    return [Item("/touch/teng", samples, 1.0), Item("/camera/left", frame, 1.0),
            Item(STATE, {"state": "STABLE", "probability": float("nan")}, 1.0)]  # fmt: skip


def opened(server: FoxgloveServer, **how):
    return connect(server.url, subprotocols=[SUBPROTOCOLS[0]], max_size=None, **how)


def advertised(viewer, server, count: int) -> dict[str, dict]:
    info = json.loads(viewer.recv(timeout=5))
    assert info["capabilities"] == []  # nothing can be called, set or published
    found: dict[str, dict] = {}
    while len(found) < count:
        server.show(items())
        message = json.loads(viewer.recv(timeout=5))
        found |= {channel["topic"]: channel for channel in message["channels"]}
    return found


def subscribe(viewer, channels: dict[str, dict]) -> None:
    wanted = [{"id": 100 + c["id"], "channelId": c["id"]} for c in channels.values()]
    viewer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


def messages(viewer, server, count: int) -> list[tuple[int, bytes]]:
    found = []
    until_s = time.monotonic() + 5.0
    while len(found) < count and time.monotonic() < until_s:
        server.show(items())
        try:
            data = viewer.recv(timeout=0.05)
        except TimeoutError:
            continue
        assert data[0] == 1
        found.append((int.from_bytes(data[1:5], "little"), data[13:]))
    return found


def test_a_viewer_sees_named_channels_images_and_states(server) -> None:
    with opened(server) as viewer:
        channels = advertised(viewer, server, 3)
        touch = json.loads(channels["/touch/teng"]["schema"])
        assert list(touch["properties"]) == ["thumb", "index"]
        image = channels["/camera/left"]
        assert image["schemaName"] == "sensor_msgs/msg/CompressedImage"
        subscribe(viewer, channels)
        shown = dict(messages(viewer, server, 8))
    assert json.loads(shown[100 + channels["/state"]["id"]]) == {
        "state": "STABLE", "probability": None}  # fmt: skip
    assert shown[100 + image["id"]].endswith(JPEG)
    assert set(json.loads(shown[100 + channels["/touch/teng"]["id"]])) == {"thumb", "index"}


def test_an_image_is_what_ros_2_says(server) -> None:
    """Decoded with the package that ROS 2 users have for it."""
    decoder = pytest.importorskip("mcap_ros2._dynamic", reason="needs mcap-ros2-support")

    frame = Frame(camera=0, jpeg=JPEG, counter=0, device_s=0.0, arrival_s=0.0, fitted_s=1.0)
    channel = Channel(1, "/camera/left", True, "").as_json()
    read = decoder.generate_dynamic(channel["schemaName"], channel["schema"])
    _, pieces = image_message(frame, "left", 500_000_002)
    found = read[channel["schemaName"]](b"".join(pieces))
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == (1, 500_000_002)
    assert (found.header.frame_id, found.format, bytes(found.data)) == ("left", "jpeg", JPEG)


@pytest.mark.parametrize(
    "how",
    [
        {"origin": "http://evil.example"},
        {"origin": "http://127.0.0.1.evil.example"},
        {"origin": "http://localhost:8080.evil.example"},
    ],
)
def test_another_sites_page_is_refused(server, how) -> None:
    with pytest.raises((InvalidStatus, ConnectionClosed)), opened(server, **how) as viewer:
        viewer.recv(timeout=5)
    assert server.refused == 1


def test_a_name_that_was_made_to_point_here_is_refused(server) -> None:
    port = int(server.url.rpartition("/")[0].rpartition(":")[2])
    address = server.url.replace("127.0.0.1", "evil.example")
    here = socket.create_connection(("127.0.0.1", port))
    with pytest.raises(InvalidStatus):
        connect(address, sock=here, subprotocols=[SUBPROTOCOLS[0]])
    assert server.refused == 1


@pytest.mark.parametrize("origin", ["https://app.foxglove.dev", "http://localhost:8080", None])
def test_viewers_of_this_machine_get_in(server, origin) -> None:
    with opened(server, origin=origin) as viewer:
        assert json.loads(viewer.recv(timeout=5))["op"] == "serverInfo"


def test_nobody_gets_in_without_the_key(server) -> None:
    address = server.url.rpartition("/")[0]
    for path in ("", "/", "/" + "a" * 43):
        with pytest.raises(InvalidStatus):
            connect(address + path, subprotocols=[SUBPROTOCOLS[0]])


def test_what_would_change_something_is_refused(server) -> None:
    with opened(server) as viewer:
        for text in ('{"op":"advertise","channels":[]}', '{"op":"setParameters"}', "[]", "x",
                     '{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}'):  # fmt: skip
            viewer.send(text)
        channels = advertised(viewer, server, 3)
        subscribe(viewer, channels)
        assert messages(viewer, server, 3)
    assert server.refused == 5


def test_a_viewer_that_reads_nothing_misses_the_oldest_and_holds_nobody_up(server) -> None:
    big = Frame(camera=0, jpeg=bytes(200_000), counter=0, device_s=0.0, arrival_s=0.0, fitted_s=0.0)
    with opened(server, max_queue=1, close_timeout=0.1) as slow, opened(server) as quick:
        channels = advertised(slow, server, 3)
        advertised(quick, server, 3)
        subscribe(slow, channels)
        subscribe(quick, {"/state": channels["/state"]})
        messages(quick, server, 1)
        stop = threading.Event()

        def flood() -> None:
            while not stop.is_set() and not server.dropped:
                server.show([Item("/camera/left", big, 1.0)] * 20)
                stop.wait(0.005)

        flooding = threading.Thread(target=flood)
        flooding.start()
        flooding.join(20.0)
        stop.set()
        flooding.join()
        assert server.dropped > 0
        assert all(len(viewer.waiting) <= MOST_WAITING for viewer in server._viewers)
        assert messages(quick, server, 2)


def test_a_request_is_read_to_the_letter() -> None:
    text = '{"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]}'
    assert read_request(text) == ("subscribe", {0: 3})
    assert read_request('{"op":"unsubscribe","subscriptionIds":[0]}') == ("unsubscribe", [0])
    with pytest.raises(ValueError, match="whole number"):
        read_request('{"op":"unsubscribe","subscriptionIds":[true]}')


@pytest.mark.parametrize(("rate_hz", "shown"), [(50, 50), (100, 100), (1000, 100)])
def test_of_a_second_each_row_of_the_grid_is_shown(rate_hz, shown):
    """Times of 100 Hz, in floating point, are not 0.01 s apart to the last bit."""
    times_s = 12_345.678 + np.arange(rate_hz) / rate_hz
    samples = Samples.from_values(np.ones((rate_hz, 1)), times_s)

    assert len(Rows(("a",)).of(samples)) == shown
