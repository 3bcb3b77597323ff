"""Claims about addresses: what opens, and one plain line for what does not."""

from pathlib import Path

import pytest

from taxel.clock import ManualClock
from taxel.errors import BadInput, BadRecording, BadSource, TaxelError
from taxel.foreign.addresses import read_options, write_options
from taxel.labels.trials import order_in_time, trials_of
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import SensorInfo
from taxel.sources.opening import (
    at_full_speed,
    open_source,
    recordings_of,
    refuse_replayed,
    replayed_files,
)

BAD = {
    "sim://hand": "sim://teng",
    "sim://": "sim://, replay://",
    "serial:///dev/no-such-board": "/dev/no-such-board",
    "camera:///dev/no-such-camera": "/dev/no-such-camera",
    "": "sim://, replay://",
    "nonsense": "sim://, replay://",
    "sim://[": "sim://teng",
    "sim://teng?colour=red": "preset, seed, wiring",
    "sim://teng?sessions=3": "preset, seed, wiring",
    "sim://teng?preset=fair": "honest, paper",
    "sim://teng?wiring=two-boards": "three-boards, one-board",
    "sim://teng?shape=cube": "sphere, cylinder, rectangle",
    "sim://teng?material=wood": "aluminium, glass, plastic",
    "sim://teng?seed=x": "whole number",
    "sim://teng?seed=1.5": "whole number",
    "sim://teng?seed=-1": "within 0",
    "sim://teng?rate_hz=fast": "a number",
    "sim://teng?rate_hz=nan": "within 1 and 100000",
    "sim://teng?rate_hz=0": "within 1 and 100000",
    "sim://teng?humidity_pct=30..x": "range",
    "sim://teng?humidity_pct=60..30": "smaller first",
    "sim://teng?dust=7": "within 0 and 1",
    "sim://teng?seconds=-1": "above 0 s",
    "sim://teng?speed=0": "above 0, or max",
    "sim://teng?speed=nan": "above 0, or max",
    "sim://teng?speed=quick": "above 0, or max",
    "sim://teng?seed": "key=value",
    "sim://teng?seed=1&seed=2": "once",
    "replay://": "sim://, replay://",
    "replay://.": "one recording",
    "replay://x.mcap?loop=1": "speed",
}


@pytest.mark.parametrize("url", BAD)
def test_a_bad_address_gives_one_line_that_says_what_exists(url: str):
    with pytest.raises(BadSource) as caught:
        open_source(url, ManualClock())
    assert BAD[url] in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("url", ["gone.mcap", "replay:///gone/gone.mcap"])
def test_a_missing_recording_is_named(url: str):
    with pytest.raises(BadRecording, match=r"gone\.mcap"):
        open_source(url, ManualClock())


@pytest.mark.parametrize("name", ["plain.mcap", "with space.mcap", "50%.mcap", "why?.mcap"])
def test_a_recording_opens_by_its_bare_name_whatever_that_is(tmp_path: Path, name: str):
    info = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=10.0)
    with Recorder(tmp_path / name, Manifest(sensor=info)):
        pass
    with open_source(str(tmp_path / name), ManualClock()) as source:
        assert source.info == info
        assert source.ended


def test_a_relative_path_follows_the_slashes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    info = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=10.0)
    with Recorder(tmp_path / "runs" / "x.mcap", Manifest(sensor=info)):
        pass
    monkeypatch.chdir(tmp_path)
    for url in ("replay://runs/x.mcap", "runs/x.mcap?speed=2"):
        with open_source(url, ManualClock()) as source:
            assert source.info == info


def test_a_recording_that_is_replayed_is_not_recorded_over_under_any_of_its_names(tmp_path: Path):
    info = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=10.0)
    file, link, other = (tmp_path / name for name in ("x.mcap", "link.mcap", "other.mcap"))
    with Recorder(file, Manifest(sensor=info)):
        pass
    link.symlink_to(file)
    for url in (str(file), f"replay://{file}?speed=max", str(link)):
        with pytest.raises(BadInput, match="which is replayed; name a new file"):
            refuse_replayed(file, ["sim://teng", url])
    refuse_replayed(other, ["sim://teng", str(file)])


def test_full_speed_is_added_only_where_no_speed_is_named():
    assert at_full_speed("sim://teng") == "sim://teng?speed=max"
    assert at_full_speed("sim://teng?seed=2") == "sim://teng?seed=2&speed=max"
    assert at_full_speed("sim://teng?speed=3") == "sim://teng?speed=3"
    assert at_full_speed("a/b.mcap") == "replay://a/b.mcap?speed=max"


@pytest.mark.parametrize("name", ["why?.mcap", "so? why?.mcap", "a?b"])
def test_a_name_with_question_marks_takes_options_as_well(tmp_path: Path, name: str):
    info = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=10.0)
    file = tmp_path / name if name.endswith(".mcap") else tmp_path / name / "x.mcap"
    with Recorder(file, Manifest(sensor=info)):
        pass
    for url in (f"replay://{tmp_path / name}?speed=2", at_full_speed(str(tmp_path / name))):
        (own,) = recordings_of(url)
        assert replayed_files(own) == [file]
        with open_source(own, ManualClock()) as source:
            assert source.info == info


def test_a_folder_is_replayed_in_the_order_in_which_levels_are_followed_offline(tmp_path: Path):
    """As people count: cup_2 before cup_10."""
    info = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=10.0)
    for number in (10, 1, 2):
        with Recorder(tmp_path / f"cup_{number}.mcap", Manifest(sensor=info)):
            pass
    files = replayed_files(str(tmp_path))
    trials = [trial for file in files for trial in trials_of(file, Manifest(sensor=info), [], 0, 1)]

    assert [file.stem for file in files] == ["cup_1", "cup_2", "cup_10"]
    assert recordings_of(str(tmp_path)) == list(map(str, files))
    assert sorted(trials, key=order_in_time) == trials


def test_options_come_through_another_address_as_they_were():
    """A plus sign is itself, a percent sign escapes."""
    assert read_options("config=/home/c++/a.json") == {"config": "/home/c++/a.json"}
    odd = {"a": "50% & more?", "b": "/dev/x y,[::1]:5", "c": "ä=+#"}
    assert read_options(write_options(odd)) == odd
    assert write_options({"rate_hz": "30", "port": "/dev/a,b"}) == "rate_hz=30&port=/dev/a,b"


def test_every_bad_address_is_an_error_of_taxels():
    assert issubclass(BadSource, TaxelError)
    assert issubclass(BadSource, ValueError)
