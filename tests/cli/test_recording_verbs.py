"""Claims about the verbs record, recover, import and info."""

import json
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.options.pairs import parse_pairs
from taxel.cli.recordings.import_ import Import
from taxel.cli.recordings.info import Info
from taxel.cli.recordings.record import Record
from taxel.cli.recordings.recording import (
    TOGETHER_S,
    ledger_line,
    record_source,
    stop_signals,
)
from taxel.cli.recordings.recover import Recover
from taxel.errors import BadInput, BadSource
from taxel.recordings.manifest import NO_ARRAY
from taxel.recordings.reader import iterate_frames, read_manifest, read_recording
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo


class Numbered:
    """A source of 1 kHz whose channel 0 is the scan's number, ten scans a read."""

    info = SensorInfo(name="t", channels=("n", "x"), units=("1", "V"), rate_hz=1000.0)

    def __init__(self, scans: int) -> None:
        self.left = scans
        self.given = 0

    @property
    def ended(self) -> bool:
        return self.given >= self.left

    def read(self, timeout_s: float = 0.1) -> Samples:
        number = np.arange(self.given, min(self.given + 10, self.left))
        self.given += len(number)
        return Samples.from_values(np.stack([number, number * 0], axis=1), 7.0 + number / 1000.0)

    cameras: tuple[CameraInfo, ...] = ()

    def frames(self) -> list[Frame]:
        return []

    def marks(self) -> list[Mark]:
        ended = self.given % 100 == 0
        return [Mark(start_s=7.0, end_s=7.05, labels={"k": "v"})] if ended else []

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None: ...


class Filmed(Numbered):
    """As above, with two cameras of 100 Hz whose frames come three reads late."""

    cameras = tuple(
        CameraInfo(name=name, width=320, height=240, rate_hz=100.0) for name in ("left", "right")
    )

    def __init__(self, scans: int, array: bool = True) -> None:
        super().__init__(scans)
        self.seen = -3
        if not array:
            self.info = NO_ARRAY

    def read(self, timeout_s: float = 0.1) -> Samples:
        samples = super().read(timeout_s)
        return samples if self.info.channels else Samples.empty(0)

    def frames(self) -> list[Frame]:
        number, self.seen = self.seen, self.seen + 1
        time_s = 7.0 + number / 100
        return [
            Frame(camera=camera, jpeg=b"%d" % number, counter=number, device_s=time_s,
                  arrival_s=time_s + 0.03, fitted_s=time_s)
            for camera in (0, 1) if number >= 0
        ]  # fmt: skip


def record(source: Numbered, output: Path, seconds: float, **kwargs):
    return record_source(source, output, seconds, labels={"a": "b"}, groups={"s": "1"}, **kwargs)


def test_exactly_the_wanted_time_is_recorded(tmp_path):
    """255 ms at 1 kHz are the scans 0 to 254, with marks, labels and groups."""
    ledger = record(Numbered(10_000), tmp_path / "a.mcap", 0.255)
    recording = read_recording(tmp_path / "a.mcap")
    np.testing.assert_array_equal(recording.samples.values[:, 0], np.arange(255))
    assert len(recording.marks) == 2
    assert (recording.manifest.labels, recording.manifest.groups) == ({"a": "b"}, {"s": "1"})
    assert (ledger["scans"], ledger["ended"]) == (255, "cleanly")


@pytest.mark.parametrize("array", [True, False])
def test_cameras_are_recorded_to_the_same_moment_as_the_array(tmp_path, capsys, array):
    """255 ms at 100 Hz are the frames 0 to 25 of each, also where they come late or alone."""
    ledger = record(Filmed(10_000, array), tmp_path / "a.mcap", 0.255)
    assert read_manifest(tmp_path / "a.mcap").cameras == Filmed.cameras
    for camera in (0, 1):
        kept = list(iterate_frames(tmp_path / "a.mcap", camera))
        assert [frame.counter for frame in kept] == list(range(26))
        assert kept[7].jpeg == b"7"
    assert (ledger["scans"], ledger["ended"]) == (255 if array else 0, "cleanly")
    assert ledger["cameras"]["right"]["frames"] == 26
    assert "camera left: 26 frames in 0.25 s, 100.00 frames/s measured" in ledger_line(ledger)
    assert ("scans" in ledger_line(ledger)) == array
    Info(path=tmp_path / "a.mcap").run()
    assert "right 320×240: 26 frames" in capsys.readouterr().out
    Info(path=tmp_path).run()
    assert "52 frames" in capsys.readouterr().out


def test_a_camera_that_stands_still_does_not_hold_up_the_end(tmp_path):
    """Half a second after the end the recording is complete without it."""
    source = Filmed(10_000)
    source.seen = -10_000
    ledger = record(source, tmp_path / "a.mcap", 0.255)
    assert (ledger["scans"], ledger["cameras"]["left"]["frames"]) == (255, 0)
    assert source.given <= 255 + 500 + 10


def test_a_group_given_for_the_recording_goes_before_what_the_source_says(tmp_path):
    class Simulated(Numbered):
        def marks(self) -> list[Mark]:
            return [replace(mark, groups={"session": "live", "grasp": "1"})
                    for mark in super().marks()]  # fmt: skip

    path = tmp_path / "a.mcap"
    record_source(Simulated(500), path, 0.2, labels={}, groups={"session": "mine"})
    recording = read_recording(path)
    assert recording.manifest.groups == {"session": "mine"}
    assert recording.marks[0].groups == {"grasp": "1"}


def test_a_grasp_that_begins_after_the_end_is_no_mark_of_the_recording(tmp_path):
    """A simulator at full speed gives seconds in one read: such a trial had no scan in the file."""

    class Hurried(Numbered):
        def marks(self) -> list[Mark]:
            first = 7.0  # of `Numbered`
            return [Mark(start_s=first + s, end_s=first + s + 0.1, labels={"shape": "ball"})
                    for s in (0.05, 0.195, 0.2, 0.3)]  # fmt: skip

    record(Hurried(500), tmp_path / "a.mcap", 0.2)
    starts = {round(mark.start_s, 3) for mark in read_recording(tmp_path / "a.mcap").marks}
    assert starts == {7.05, 7.195}


def test_a_source_that_ends_ends_the_recording(tmp_path):
    """A short replay gives a short, complete recording."""
    assert record(Numbered(33), tmp_path / "a.mcap", 10.0)["scans"] == 33


def test_a_stop_before_the_first_scan_is_not_taken_for_a_silent_source(tmp_path):
    """Ctrl-C at once: it said that none came in 5 s."""
    with pytest.raises(BadSource, match="none before it was stopped"):
        record(Numbered(10_000), tmp_path / "a.mcap", 10.0, stopped=lambda: True)
    assert list(tmp_path.iterdir()) == []


def test_a_stop_completes_the_file(tmp_path):
    """When asked to stop, what was measured is kept and the file says why it ended."""
    questions = iter([False] * 4 + [True] * 99)
    record(Numbered(10_000), tmp_path / "a.mcap", 5.0, stopped=lambda: next(questions))
    recording = read_recording(tmp_path / "a.mcap")
    assert 0 < len(recording.samples) < 100
    assert recording.statistics["ended"] == "stopped"


def test_a_source_without_scans_leaves_no_file(tmp_path):
    """One plain line instead of an empty recording."""
    with pytest.raises(BadSource, match="none before it ended"):
        record(Numbered(0), tmp_path / "a.mcap", 1.0)
    assert list(tmp_path.iterdir()) == []


def test_what_is_replayed_is_not_recorded_over(tmp_path):
    """Two tenths of a second do not take the place of the second that they come from."""
    file = tmp_path / "a.mcap"
    record(Numbered(1000), file, 1.0)
    before = file.read_bytes()
    with pytest.raises(BadInput, match="which is replayed"):
        Record(f"replay://{file}?speed=max", file, 0.2, overwrite=True).run()
    assert file.read_bytes() == before


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signals_become_a_question_and_are_given_back(name, capsys):
    """A signal ends nothing by itself; the handlers from before are restored."""
    number = getattr(signal, name)
    before = signal.getsignal(number)
    with stop_signals() as stopped:
        assert not stopped()
        signal.raise_signal(number)
        assert stopped()
    assert signal.getsignal(number) is before
    assert "stopping" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_that_comes_twice_at_once_is_one_and_a_later_one_kills(name, capsys, monkeypatch):
    """As from a service manager; what the first one has begun is completed. Never for long."""
    number, now_s = getattr(signal, name), 5.0
    set_to = []
    with stop_signals(clock=lambda: now_s) as stopped, monkeypatch.context() as patched:
        handlers = [signal.getsignal(own) for own in (number, number, signal.SIGTERM)]
        patched.setattr(signal, "signal", lambda *words: set_to.append(words))
        patched.setattr(signal, "raise_signal", sys.exit)
        for handler in handlers:
            handler(number, None)
            now_s += 0.05
        assert stopped()
        assert set_to == []
        now_s = 5.0 + TOGETHER_S
        with pytest.raises(SystemExit) as ended:
            handlers[0](number, None)
    assert ended.value.code == number
    assert set_to == [(number, signal.SIG_DFL)]
    assert capsys.readouterr().err.count("stopping") == 1


def test_pairs_are_names_and_values():
    """In one option or several; anything else is one plain line."""
    assert parse_pairs((("a=1", "b=x=y"), ("c=3",)), "--label") == {"a": "1", "b": "x=y", "c": "3"}
    for wrong in ("a", "=1", "a="):
        with pytest.raises(BadInput, match="--label NAME=VALUE"):
            parse_pairs(((wrong,),), "--label")
    with pytest.raises(BadInput, match="twice"):
        parse_pairs((("a=1",), ("a=2",)), "--label")


def test_recover_prints_what_was_saved(tmp_path, capsys):
    """As JSON and as one line for a person."""
    record(Numbered(500), tmp_path / "a.mcap", 5.0)
    content = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) - 200])
    Recover(file=tmp_path / "cut.mcap", output=tmp_path / "b.mcap", json=True).run()
    report = json.loads(capsys.readouterr().out)
    assert (report["scans"], report["was_complete"]) == (500, False)
    Recover(file=tmp_path / "cut.mcap", output=tmp_path / "c.mcap").run()
    assert "500 scans" in capsys.readouterr().out


def test_import_then_info_shows_what_there_is(tmp_path, capsys):
    """From a table to figures, for a file and for a folder, as text and as JSON."""
    (tmp_path / "a.csv").write_text("t,x\n1,5\n2,7\n")
    table = tmp_path / "table.csv"
    table.write_text("file,label:sign,channels,time\na.csv,B,x[N],t[s]\n")
    out = tmp_path / "out"
    Import(table=str(table), output=out, json=True).run()
    expected = {"recordings": [str(out / "a.mcap")], "notes": []}
    assert json.loads(capsys.readouterr().out) == expected
    Info(path=out / "a.mcap", json=True).run()
    summary = json.loads(capsys.readouterr().out)
    assert summary["channels"][0] | {"mean": 0} == {
        "name": "x",
        "unit": "N",
        "min": 5.0,
        "mean": 0,
        "max": 7.0,
        "saturated_share": 0.0,
        "unusable_share": 0.0,
    }
    Info(path=out, json=True).run()
    assert len(json.loads(capsys.readouterr().out)) == 1
    Info(path=out).run()
    assert "sign: B=1" in capsys.readouterr().out
    Info(path=out / "a.mcap").run()
    assert "checksums valid" in capsys.readouterr().out


def test_a_known_data_set_needs_its_folder(tmp_path):
    """The data are not part of taxel."""
    with pytest.raises(BadInput, match="--data FOLDER"):
        Import(table="teng-glove", output=tmp_path / "out").run()
