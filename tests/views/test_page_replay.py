"""A recording behind the page: what its cursor shows is what was recorded at that moment."""

from pathlib import Path

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.errors import BadRecording
from taxel.frame_codec import encode_jpeg
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_frames, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.views.page import replay_link
from taxel.views.page.link import ReplayControls
from taxel.views.page.replay_index import read_chunk
from taxel.views.page.replay_link import ReplayLink

CHANNELS = 3


def _image(number: int) -> bytes:
    """Return an image of its own for each number."""
    shade = np.full((8, 8, 3), (number % 256, number // 256, 0), np.uint8)
    return encode_jpeg(shade)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """50 s at 200 scans a second from 1000 s on, channel 0 the scan's time; 10 images a second."""
    path = tmp_path_factory.mktemp("replay") / "hand.mcap"
    info = SensorInfo(
        name="own", channels=("time", "wave", "step"), units=("s", "V", "V"), rate_hz=200.0
    )
    camera = CameraInfo(name="left", width=8, height=8, rate_hz=10.0)
    time_s = 1000 + np.arange(10_000) / 200
    values = np.stack([time_s - 1000, np.sin(time_s), time_s > 1025], axis=1)
    values[4000:4100, 1] = np.nan
    samples = Samples.from_values(values.astype(np.float32), time_s)
    with Recorder(path, Manifest(sensor=info, cameras=(camera,), labels={"shape": "ball"})) as file:
        for first in range(0, 10_000, 500):
            file.write(samples[first : first + 500])
            for number in range(first // 20, (first + 500) // 20):
                at_s = 1000 + number / 10
                file.frame(
                    Frame(camera=0, jpeg=_image(number), counter=number, device_s=at_s,
                          arrival_s=at_s, fitted_s=at_s)
                )  # fmt: skip
            file.flush()
        file.mark(Mark(start_s=1010.0, end_s=1020.0, labels={"grasp": "stable"}))
    return path


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(77.0)


@pytest.fixture
def link(recording: Path, clock: ManualClock) -> ReplayLink:
    return ReplayLink(recording, clock)


def test_it_can_be_wound(link):
    assert isinstance(link, ReplayControls)


def test_the_cursor_starts_at_the_start_and_plays_at_its_speed_to_the_end(link, clock):
    assert link.cursor_s == 1000.0
    link.play(4.0)
    clock.advance(5.0)
    assert link.cursor_s == pytest.approx(1020.0)
    link.pause()
    clock.advance(5.0)
    assert link.cursor_s == pytest.approx(1020.0)
    link.play(4.0)
    clock.advance(100.0)
    assert link.cursor_s == pytest.approx(1049.995)
    assert not link.snapshot()["replay"]["playing"]
    link.play(1.0)
    assert link.cursor_s == 1000.0  # from the start again


@pytest.mark.parametrize(("asked", "found"), [(-5.0, 1000.0), (1e9, 1049.995), (1012.5, 1012.5)])
def test_seeking_ends_at_the_recording_s_ends(link, asked, found):
    link.seek(asked)

    assert link.cursor_s == pytest.approx(found)


def test_the_image_is_the_newest_at_the_cursor_forward_and_backward(link, recording):
    whole = list(iterate_frames(recording))
    for at_s in (1049.9, 1003.14, 1000.0, 1031.99, 1003.2):
        link.seek(at_s)
        number, jpeg = link.frame(0)
        expected = [frame for frame in whole if frame.fitted_s <= at_s][-1]
        assert (number, jpeg) == (expected.counter, expected.jpeg)
    assert link.frame(1) is None


def test_traces_are_the_recorded_values_up_to_the_cursor_each_once(link, recording):
    samples = read_recording(recording).samples
    by_time = dict(zip(samples.fitted_s.tolist(), samples.values.tolist(), strict=True))
    link.seek(1005.0)
    first = link.traces(-np.inf)
    link.seek(1008.0)
    second = link.traces(first["time_s"])

    times = first["sensors"]["t"] + second["sensors"]["t"]
    assert times == sorted(set(times))
    assert times[-1] == pytest.approx(1008.0, abs=0.021)
    assert 49 <= len(times) / 8 <= 51
    shown = np.concatenate([first["sensors"]["values"], second["sensors"]["values"]], axis=1)
    assert np.array_equal(shown.T, np.array([by_time[t] for t in times], np.float32))


def test_a_cursor_that_was_set_back_gives_its_own_past_anew_thirty_seconds_at_most(link):
    link.seek(1045.0)
    newest = link.traces(-np.inf)
    link.seek(1012.0)
    back = link.traces(newest["time_s"])

    assert newest["sensors"]["t"][0] > 1015.0
    assert back["time_s"] == 1012.0
    assert back["sensors"]["t"][0] == pytest.approx(1000.0)
    assert [event["text"] for event in back["events"]] == ["grasp stable"]


def test_what_was_not_finite_is_missing_on_the_trace_and_the_map(link):
    link.seek(1020.3)
    traces = link.traces(1020.0)

    assert np.isnan(traces["sensors"]["values"][1]).all()
    rows = np.array(traces["map"])
    assert rows.shape == (12, CHANNELS)
    assert np.isnan(rows[:, 1]).all()
    assert rows[-1, 0] == pytest.approx(20.3 / 49.995, abs=1e-3)
    assert (np.diff(rows[:, 0]) > 0).all()  # the oldest row is first


def test_the_overview_holds_every_peak_and_the_marks(link, recording):
    overview = link.overview()
    samples = read_recording(recording).samples
    wave = next(series for series in overview["series"] if series["name"] == "wave")

    assert (overview["start_s"], len(overview["t"])) == (1000.0, 600)
    assert np.nanmax(wave["high"]) == pytest.approx(np.nanmax(samples.values[:, 1]), abs=1e-3)
    assert np.isnan(wave["low"][243])  # 20.25 s: no value may be used there
    assert overview["bands"] == [
        {"start_s": 1010.0, "end_s": 1020.0, "text": "shape ball, grasp stable"}
    ]


def test_a_replay_is_never_stable_and_its_station_s_time_goes_on_while_nothing_plays(link, clock):
    before = link.snapshot()
    clock.advance(0.2)
    after = link.snapshot()

    assert before["state"] == "UNKNOWN"
    assert after["time_s"] > before["time_s"]
    assert after["replay"]["cursor_s"] == before["replay"]["cursor_s"]
    assert after["replay"]["labels"] == "shape ball"
    link.seek(1015.0)
    assert link.snapshot()["replay"]["labels"] == "shape ball, grasp stable"
    assert link.record(True, {}) != ""


def test_cameras_alone_are_overviewed_by_the_size_of_their_images(pour, tmp_path):
    link = ReplayLink(pour)

    link.seek(link.overview()["end_s"])
    number, jpeg = link.frame(1)
    assert number == 119
    assert jpeg.startswith(b"\xff\xd8")
    assert len(link.snapshot()["cameras"]) == 2


def test_only_a_few_chunks_are_held_however_far_the_cursor_goes(link):
    for at_s in np.linspace(1000, 1049, 40):
        link.seek(float(at_s))
        link.frame(0)

    assert len(link._opened) <= 4


def test_a_flipped_bit_and_a_file_without_scans_are_refused(recording, tmp_path):
    content = bytearray(recording.read_bytes())
    content[len(content) // 2] ^= 4
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(content)
    with pytest.raises(BadRecording, match="taxel recover"):
        ReplayLink(broken)

    empty = tmp_path / "empty.mcap"
    with Recorder(empty, Manifest(sensor=SensorInfo(name="a", channels=("b",), units=("V",),
                                                    rate_hz=1.0))):  # fmt: skip
        pass
    with pytest.raises(BadRecording, match="which has none"):
        ReplayLink(empty)


def test_one_moment_reads_one_chunk_at_most_and_a_small_step_none(link, monkeypatch):
    read = []

    def counted(path, number, manifest):
        read.append(number)
        return read_chunk(path, number, manifest)

    monkeypatch.setattr(replay_link, "read_chunk", counted)
    for at_s in np.linspace(1031, 1049, 20):
        before = len(read)
        for step_s in (0.0, 0.02, 0.04):
            link.seek(float(at_s) + step_s)
            link.snapshot(), link.traces(-np.inf), link.frame(0)
        assert len(read) - before <= 2  # a step may go from one chunk to the next

    assert 1 <= len(read) == len(set(map(str, read)))


@pytest.mark.parametrize("step_s", [0.01, 0.009995])
def test_an_array_of_100_hz_is_shown_whole(tmp_path: Path, step_s: float):
    """Times were sorted into hundredths of a second: two that fell into the same, by rounding or as
    a clock ran fast, were one row, and a peak in the other was not seen.
    """
    path = tmp_path / "hand.mcap"
    info = SensorInfo(name="own", channels=("a",), units=("V",), rate_hz=100.0)
    samples = Samples.from_values(np.zeros((1000, 1), np.float32), np.arange(1000) * step_s)
    with Recorder(path, Manifest(sensor=info)) as file:
        for first in range(0, 1000, 5):
            file.write(samples[first : first + 5])
    link = ReplayLink(path)
    assert len(link._index.time_s) == 1000


def test_a_channel_without_any_usable_value_leaves_the_others_their_scale(tmp_path: Path):
    """The map of an array without a full scale was drawn from 0 to 1 where a channel was dead."""
    path = tmp_path / "skin.mcap"
    info = SensorInfo(name="skin", channels=("a", "dead"), units=("N", "N"), rate_hz=50.0)
    values = np.stack([20.0 + np.arange(100) / 10, np.full(100, np.nan)], axis=1)
    with Recorder(path, Manifest(sensor=info)) as file:
        file.write(Samples.from_values(values.astype(np.float32), np.arange(100) / 50))
    link = ReplayLink(path)
    link.seek(1.0)
    shown = np.array(link.traces(-np.inf)["map"])
    assert shown[-1, 0] == pytest.approx(50 / 99, abs=0.01)
    assert np.isnan(shown[:, 1]).all()


def test_no_line_leads_across_an_outage_and_the_map_within_it_is_empty(
    tmp_path: Path, clock: ManualClock
):
    """As live: 10 s without a scan are no straight line from the last to the next."""
    info = SensorInfo(name="own", channels=("a",), units=("V",), rate_hz=100.0)
    time_s = np.r_[np.arange(100), 1100 + np.arange(100)] / 100
    with Recorder(tmp_path / "r.mcap", Manifest(sensor=info)) as file:
        file.write(Samples.from_values(1 + time_s[:, None], time_s))
    link = ReplayLink(tmp_path / "r.mcap", clock)
    link.seek(11.5)
    sensors = link.traces(-np.inf)["sensors"]
    (values,) = sensors["values"]
    empty = np.flatnonzero(np.isnan(values))

    assert len(empty) == 1
    assert 0.98 < sensors["t"][empty[0]] < 11.0
    assert sensors["t"] == sorted(sensors["t"])
    assert np.isnan(link.traces(5.0)["sensors"]["values"][0][0])
    link.seek(6.0)
    assert np.isnan(link.traces(-np.inf)["map"][-1]).all()
    link.seek(11.5)
    assert np.isfinite(link.traces(-np.inf)["map"]).all()
