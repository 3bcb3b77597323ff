"""`realsense://` through the library's own software device: no camera, the real library."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest

from taxel.clock import SystemClock
from taxel.errors import BadSource, MissingExtra
from taxel.frame_codec import decode_depth, decode_jpeg
from taxel.image_head import is_sound
from taxel.live.station.page_link import draw_depth
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_frames, iterate_tactile, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame
from taxel.sources.cameras.realsense import NAMES, SILENT_S, RealSense, parse_choice
from taxel.sources.cameras.realsense_device import (
    COLOUR,
    DEPTH,
    KEPT,
    FoundRealSense,
    list_realsense,
    realsense_module,
)
from taxel.sources.opening import open_source

try:
    rs = realsense_module()
except MissingExtra as missing:
    pytest.skip(f"{missing}", allow_module_level=True)

WIDTH, HEIGHT, RATE_HZ = 64, 48, 90
OPTIONS = {"width": str(WIDTH), "height": str(HEIGHT), "rate_hz": str(RATE_HZ)}


class SoftCamera:
    """A D435i made of software: sends frames whose depth is their number, until `unplug`."""

    def __init__(self, first: int = 100, lose: frozenset[int] = frozenset()) -> None:
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.serial_number, "123")
        self.device.register_info(rs.camera_info.name, "Intel RealSense D435I")
        depth, colour = rs.stream.depth, rs.stream.color
        self._sensors = [self.device.add_sensor("RGB"), self.device.add_sensor("Stereo Module")]
        self._profiles = [
            self._sensors[COLOUR].add_video_stream(self._stream(colour, 0, rs.format.rgb8, 3)),
            self._sensors[DEPTH].add_video_stream(self._stream(depth, 1, rs.format.z16, 2)),
        ]
        self._sensors[DEPTH].add_read_only_option(rs.option.depth_units, 0.001)
        self.first, self.lose, self.sent = first, lose, 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _stream(self, kind, uid, form, bpp):
        lens = rs.intrinsics()
        lens.width, lens.height, lens.fx, lens.fy = WIDTH, HEIGHT, 60.0, 61.0
        lens.ppx, lens.ppy, lens.model = 31.5, 23.5, rs.distortion.brown_conrady
        lens.coeffs = [0.1, 0.0, 0.0, 0.0, 0.0]
        made = rs.video_stream()
        made.type, made.index, made.uid, made.fmt, made.bpp = kind, 0, uid, form, bpp
        made.width, made.height, made.fps, made.intrinsics = WIDTH, HEIGHT, RATE_HZ, lens
        return made

    def send(self, number: int) -> None:
        """Send colour and depth of one moment, by the device's clock."""
        images = (np.full((HEIGHT, WIDTH, 3), 90, np.uint8),
                  np.full((HEIGHT, WIDTH), number, np.uint16))  # fmt: skip
        for sensor, profile, pixels in zip(self._sensors, self._profiles, images, strict=True):
            frame = rs.software_video_frame()
            frame.pixels, frame.frame_number = pixels, number
            frame.stride, frame.bpp = pixels.strides[0], pixels.strides[1]
            frame.timestamp = 1000.0 * number / RATE_HZ
            frame.domain = rs.timestamp_domain.hardware_clock
            frame.profile = profile.as_video_stream_profile()
            if pixels.dtype == np.uint16:
                frame.depth_units = 0.001
            sensor.on_video_frame(frame)

    def _run(self) -> None:
        began_s = time.monotonic()
        for number in range(self.first, 60_000):
            if self._stop.is_set():
                return
            if number not in self.lose:
                self.send(number)
            self.sent = number
            due_s = began_s + (number + 1 - self.first) / RATE_HZ
            self._stop.wait(max(0.0, due_s - time.monotonic()))

    def find(self, serial: str):
        if not self._thread.is_alive() and not self._stop.is_set():
            self._thread.start()
        return None if self._stop.is_set() or serial not in ("any", "123") else self.device

    def unplug(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.fixture
def camera():
    camera = SoftCamera()
    yield camera
    camera._stop.set()


def collect(source: RealSense, count: int, longest_s: float = 5.0) -> list[Frame]:
    found: list[Frame] = []
    until_s = time.monotonic() + longest_s
    while len(found) < count and time.monotonic() < until_s:
        source.read(0.05)
        found += source.frames()
    return found


def test_frames_come_whole_once_in_order_and_on_time(camera: SoftCamera) -> None:
    """The depth of an image is its number, so that a lost or repeated one would show."""
    with RealSense("any", OPTIONS, find=camera.find) as source:
        frames = collect(source, 60)
        colour, depth = source.cameras
    for number, info in enumerate((colour, depth)):
        own = [frame for frame in frames if frame.camera == number]
        assert [f.counter for f in own] == list(range(own[0].counter, own[0].counter + len(own)))
        assert all(is_sound(frame.jpeg, info) for frame in own)
        assert all(frame.fitted_s <= frame.arrival_s for frame in own)
        assert np.allclose(np.diff([frame.device_s for frame in own]), 1 / RATE_HZ)
    deep = [frame for frame in frames if frame.camera == DEPTH]
    assert [int(decode_depth(f.jpeg, depth)[0, 0]) for f in deep] == [f.counter for f in deep]
    assert decode_jpeg(frames[0].jpeg, colour).shape == (HEIGHT, WIDTH, 3)


def test_what_the_camera_is_says_lens_depth_unit_and_measured_rate(camera: SoftCamera) -> None:
    with RealSense("123", OPTIONS, find=camera.find) as source:
        colour, depth = source.cameras
    assert (colour.name, depth.name) == NAMES
    assert (colour.serial, colour.coding, depth.coding) == ("123", "jpeg", "png16")
    assert colour.scene
    assert depth.scene
    assert depth.details["depth_unit_m"] == "0.001"
    assert (colour.details["fx_px"], colour.details["ppy_px"]) == ("60", "23.5")
    assert colour.details["distortion_coefficients"].startswith("0.1 ")
    assert 0.7 * RATE_HZ < colour.rate_hz < 1.3 * RATE_HZ


def test_lost_frames_show_in_the_counter_and_in_a_recording(tmp_path: Path) -> None:
    camera = SoftCamera(lose=frozenset({125, 126, 130}))
    with RealSense("any", OPTIONS, find=camera.find) as source:
        cameras = source.cameras
        frames = collect(source, 60)
    camera.unplug()
    assert frames[0].counter < 125
    path = tmp_path / "scene.mcap"
    with Recorder(path, Manifest(sensor=source.info, cameras=cameras)) as recorder:
        for frame in frames:
            recorder.frame(frame)
    recording = read_recording(path)
    assert [recording.statistics["cameras"][name]["lost_frames"] for name in NAMES] == [3, 3]
    assert recording.manifest.cameras == cameras
    kept = sorted(iterate_frames(path), key=lambda frame: (frame.camera, frame.counter))
    assert kept == sorted(frames, key=lambda frame: (frame.camera, frame.counter))


def test_reading_ends_with_a_frame_or_after_the_timeout(camera: SoftCamera) -> None:
    with RealSense("any", OPTIONS, find=camera.find) as source:
        camera.unplug()
        source.frames()
        began_s = time.monotonic()
        source.read(0.05)
        assert 0.04 < time.monotonic() - began_s < 0.5
        assert source.frames() == []


def test_an_unplugged_camera_is_silent_and_comes_back(camera: SoftCamera) -> None:
    """Plugged in again its counter and clock begin anew; fitted time goes on."""
    now = [camera]
    with RealSense("any", OPTIONS, find=lambda serial: now[0].find(serial)) as source:
        before = collect(source, 20)
        camera.unplug()
        source.read(0.01)
        before += source.frames()
        gone_s = time.monotonic()
        while time.monotonic() - gone_s < SILENT_S + 0.2:
            source.read(0.05)
            assert source.frames() == []
        assert not source.ended
        now[0] = SoftCamera(first=3)
        after = collect(source, 20)
        assert source.reopened == 1
        assert after[0].counter < before[-1].counter
        assert min(f.fitted_s for f in after) > max(f.fitted_s for f in before)
        now[0].unplug()


def test_of_a_camera_that_nobody_asks_only_the_newest_is_kept(camera: SoftCamera) -> None:
    with RealSense("any", OPTIONS, find=camera.find) as source:
        collect(source, 2)
        first = camera.sent
        while camera.sent < first + 2 * KEPT:
            time.sleep(0.01)
        frames = source.frames()
        assert len(frames) == KEPT
        assert source._device is not None
        assert source._device.dropped > 0


def test_closing_ends_the_streams_and_the_source(camera: SoftCamera) -> None:
    with RealSense("any", OPTIONS, find=camera.find) as source:
        collect(source, 2)
    assert source.ended
    source.read(0.01)
    assert source.frames() == []


@pytest.mark.parametrize(
    ("options", "needed"),
    [
        ({"speed": "2"}, "options of realsense://"),
        ({"width": "x"}, "width of realsense:// as a whole number"),
        ({"rate_hz": "0"}, "within 1 and 300"),
        ({"width": "9999999"}, "within 16 and 4096"),
    ],
)
def test_a_wrong_option_is_refused(options: dict[str, str], needed: str) -> None:
    with pytest.raises(BadSource, match=needed):
        parse_choice(options)


def test_a_camera_that_is_not_there_or_lacks_the_mode_is_refused(camera: SoftCamera) -> None:
    with pytest.raises(BadSource, match="plugged in"):
        open_source("realsense://no-such-camera", SystemClock())
    with pytest.raises(BadSource, match="64×48 at 90/s"):
        RealSense("any", OPTIONS | {"rate_hz": "30"}, find=camera.find)


def test_a_camera_that_sends_nothing_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taxel.sources.cameras.realsense._FIRST_S", 0.2)
    silent = SoftCamera()
    with pytest.raises(BadSource, match="0 of scene and 0 of scene-depth"):
        RealSense("any", OPTIONS, find=lambda _: silent.device)


def test_models_are_never_shown_what_looks_on(tmp_path: Path, camera: SoftCamera) -> None:
    """Touch recorded beside a scene reads as touch alone, whichever came first."""
    with RealSense("any", OPTIONS, find=camera.find) as source:
        scene, depth = source.cameras
        frames = collect(source, 8)
    left = CameraInfo(name="left", width=WIDTH, height=HEIGHT, rate_hz=30.0)
    path = tmp_path / "both.mcap"
    picture = next(frame for frame in frames if frame.camera == COLOUR)
    with Recorder(path, Manifest(sensor=source.info, cameras=(scene, left, depth))) as recorder:
        for camera_number in (0, 1):
            recorder.frame(Frame(camera=camera_number, jpeg=picture.jpeg, counter=1, device_s=0.0,
                                 arrival_s=1.0, fitted_s=1.0))  # fmt: skip
    assert [frame.camera for frame in iterate_tactile(path)] == [0]
    with open_source(f"replay://{path}?speed=max") as replayed:
        assert [camera.name for camera in replayed.cameras] == ["left"]
    with open_source(f"replay://{path}?speed=max&scene=yes") as replayed:
        assert [camera.name for camera in replayed.cameras] == ["scene", "left", "scene-depth"]


def test_depth_is_drawn_for_people_and_what_is_no_depth_is_not(camera: SoftCamera) -> None:
    with RealSense("any", OPTIONS, find=camera.find) as source:
        colour, depth = source.cameras
        frames = collect(source, 8)
    png = next(frame.jpeg for frame in frames if frame.camera == DEPTH)
    drawn = draw_depth(png, depth)
    assert drawn is not None
    assert is_sound(drawn, colour)
    head = png[:16] + (20_000).to_bytes(4, "big") + png[20:]
    text = png[:33] + b"\x00\x00\x00\x04zTXtabcd\x00\x00\x00\x00" + png[33:]
    for hostile in (head, text, png[:-12], png + b"x", b"\x89PNG\r\n\x1a\n", b"", png[:40]):
        assert not is_sound(hostile, depth)
        assert draw_depth(hostile, depth) is None


def test_cameras_that_are_plugged_in_are_listed_without_starting_them(camera) -> None:
    """By what the library's device says; a fact that it does not know is empty."""
    found = list_realsense(lambda: [camera.device])

    assert found == [FoundRealSense("Intel RealSense D435I", "123", "")]
    assert found[0].address == "realsense://123"
    assert not camera._thread.is_alive()


def test_a_library_that_cannot_look_is_one_line() -> None:
    def fail():
        raise RuntimeError("no access to USB")

    with pytest.raises(BadSource, match="no access to USB"):
        list_realsense(fail)
