"""Claims about the figures that `taxel info` prints."""

import numpy as np
import pytest

from taxel.errors import BadRecording
from taxel.recordings.reader import read_recording
from taxel.recordings.summary import recorded_s, summarise
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Validity


def test_the_figures_are_those_of_the_scans(finished):
    """Minimum, mean and maximum equal numpy's over the whole recording."""
    values = read_recording(finished).samples.values.astype(np.float64)
    summary = summarise(finished)
    assert summary["scans"] == 120
    assert summary["rate_hz"] == pytest.approx(1000.0)
    assert summary["labels"] == {"shape": "sphere"}
    assert summary["marks_by_label"] == {"grasp": {"stable": 1}}
    for i, channel in enumerate(summary["channels"]):
        assert channel["min"] == values[:, i].min()
        assert channel["max"] == values[:, i].max()
        assert channel["mean"] == pytest.approx(values[:, i].mean())


def test_values_that_may_not_be_used_enter_no_figure(tmp_path, manifest, numbered):
    """A missing value's number is ignored; its share is told; saturated values count."""
    samples = numbered(0, 100)
    samples.values[:25, 1] = 1e9
    samples.validity[:25, 1] = Validity.MISSING
    samples.validity[:10, 2] = Validity.SATURATED
    samples.validity[:, 3] = Validity.STALE
    with Recorder(tmp_path / "a.mcap", manifest) as recorder:
        recorder.write(samples)
    _, missing, saturated, stale = summarise(tmp_path / "a.mcap")["channels"]
    assert missing["max"] < 10
    assert missing["unusable_share"] == 0.25
    assert saturated["saturated_share"] == pytest.approx(0.1)
    assert (stale["min"], stale["mean"], stale["max"]) == (None, None, None)


def test_a_recording_without_scans_has_no_rate(tmp_path, manifest):
    """Nothing is divided by nothing."""
    with Recorder(tmp_path / "a.mcap", manifest) as recorder:
        recorder.mark(Mark(start_s=0.0, end_s=1.0, labels={}))
    summary = summarise(tmp_path / "a.mcap")
    assert (summary["scans"], summary["rate_hz"], summary["marks"]) == (0, None, 1)


def test_a_damaged_recording_gets_no_figures(finished):
    """The check sums are verified before anything is printed."""
    content = bytearray(finished.read_bytes())
    content[-300] ^= 1
    finished.write_bytes(content)
    with pytest.raises(BadRecording, match="taxel recover"):
        summarise(finished)


def test_a_recording_lasts_as_long_as_its_array_or_its_longest_camera():
    cameras = [{"duration_s": 2.0}, {"duration_s": 3.5}]

    assert recorded_s({"duration_s": 1.0, "cameras": cameras}) == 3.5
    assert recorded_s({"duration_s": 1.0, "cameras": []}) == 1.0
