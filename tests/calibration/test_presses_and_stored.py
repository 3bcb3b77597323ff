"""Tables of presses, and calibration files: read right, or refused with their place."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.calibration.presses import Press, Script, script_of_marks, script_of_table
from taxel.calibration.responses import measure_responses
from taxel.calibration.stored import document_of, read_calibration, write_calibration
from taxel.errors import BadDataset, BadInput, BadTable
from taxel.signals import Mark, Samples, SensorInfo

INFO = SensorInfo(name="pads", channels=("a", "b"), units=("V", "V"), rate_hz=100.0)


def table(path: Path, text: str) -> Path:
    file = path / "presses.csv"
    file.write_text(text)
    return file


def test_a_table_s_times_count_from_the_first_scan(tmp_path: Path) -> None:
    file = table(tmp_path, "sensor,force_n,start_s,end_s\nb,1.5,0.5,1.0\n1,2,2,3\n")
    one, two = script_of_table(file, INFO, first_s=100.0).presses

    assert (one.channel, one.force_n, one.start_s, one.end_s) == (1, 1.5, 100.5, 101.0)
    assert two.channel == 0


def test_directions_and_rounds_follow_from_the_order_of_the_forces(tmp_path: Path) -> None:
    forces = [1, 2, 4, 4.1, 2, 1, 1, 2, 4, 2]
    rows = "".join(f"a,{force},{i},{i + 0.5}\n" for i, force in enumerate(forces))
    found = script_of_table(table(tmp_path, f"sensor,force_n,start_s,end_s\n{rows}"), INFO, 0.0)

    assert [press.rising for press in found.presses] == [True] * 4 + [False] * 3 + [
        True,
        True,
        False,
    ]
    assert [press.round for press in found.presses] == [1] * 7 + [2] * 3


def test_known_voltages_are_on_one_pin_or_on_all(tmp_path: Path) -> None:
    file = table(tmp_path, "sensor,force_n,start_s,end_s,reference_v\nb,,1,2,3.3\n,,3,4,1.65\n")
    single, every = script_of_table(file, INFO, 0.0).references

    assert (single.channel, single.volts) == (1, 3.3)
    assert (every.channel, every.volts) == (None, 1.65)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "columns"),
        ("sensor,force_n,start_s\na,1,0\n", "end_s"),
        ("sensor,force_n,start_s,end_s,colour\na,1,0,1,red\n", "colour"),
        ("sensor,force_n,start_s,end_s\nc,1,0,1\n", "'c' in .*line 2"),
        ("sensor,force_n,start_s,end_s\n3,1,0,1\n", "'3' in .*line 2"),
        ("sensor,force_n,start_s,end_s\na,1,0,1\na,-1,2,3\n", "line 3"),
        ("sensor,force_n,start_s,end_s\na,nan,0,1\n", "force_n"),
        ("sensor,force_n,start_s,end_s\na,1,2,1\n", "end after"),
        ("sensor,force_n,start_s,end_s\na,1,-2,1\n", "from 0 s"),
        ("sensor,force_n,start_s,end_s\na,1,0\n", "cells"),
        ("sensor,force_n,start_s,end_s\na,1,0,1,9\n", "cells"),
        (
            "sensor,force_n,start_s,end_s\na,1,0,2\nb,1,1,3\n",
            r"in .*line 3 that begins before that in .*line 2",
        ),
        ("sensor,force_n,start_s,end_s,direction\na,1,0,2,sideways\n", "sideways"),
        ("sensor,force_n,start_s,end_s,round\na,1,0,2,1e300\n", "round; got '1e300' in .*line 2"),
        ("sensor,force_n,start_s,end_s,round\na,1,0,2,1.5\n", "a whole number .* got '1.5'"),
    ],
)
def test_a_bad_table_is_refused_with_its_place(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(BadTable, match=says):
        script_of_table(table(tmp_path, text), INFO, 0.0)


def test_a_press_outside_the_recording_is_named_by_the_table_s_own_times() -> None:
    """Milliseconds instead of seconds: the scans' clock would not be recognised by its writer."""
    time_s = 5000.0 + np.arange(1000) * 0.01
    samples = Samples.from_values(np.zeros((1000, 2)), time_s)
    press = Press(channel=0, force_n=1.0, start_s=6000.0, end_s=6800.0)
    with pytest.raises(
        BadDataset, match=r"from 1000\.000 to 1800\.000 s after the first scan; .* lasts 9\.990 s"
    ):
        measure_responses(samples, Script(presses=(press,)), 100.0, "peak")


def test_a_table_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "presses.csv").write_bytes(b"\xff\xfe\x00sensor" * 40)
    with pytest.raises(BadTable):
        script_of_table(tmp_path / "presses.csv", INFO, 0.0)
    with pytest.raises(BadTable, match="No such file"):
        script_of_table(tmp_path / "none.csv", INFO, 0.0)


def test_marks_without_a_force_are_passed_over_and_bad_ones_named() -> None:
    other = Mark(start_s=0.0, end_s=9.0, labels={"shape": "sphere"})
    press = Mark(start_s=1.0, end_s=2.0, labels={"sensor": "b", "force_n": "2"})

    assert len(script_of_marks([other, press], INFO).presses) == 1
    bad = Mark(start_s=3.0, end_s=4.0, labels={"sensor": "b", "force_n": "much"})
    with pytest.raises(BadDataset, match=r"'much' in the mark at 3\.000 s"):
        script_of_marks([press, bad], INFO)


@pytest.fixture(scope="module")
def document(three_boards: Any) -> dict[str, Any]:
    return document_of(three_boards.found, [{"source": "here", "presses": 1}], {"seed": 0})


def test_what_was_written_is_read_back(
    three_boards: Any, document: dict[str, Any], tmp_path: Path
) -> None:
    write_calibration(tmp_path / "c.json", document)
    read = read_calibration(tmp_path / "c.json")

    assert read.digest == document["sha256"]
    for channel, made in zip(read.channels, three_boards.found.sensors, strict=True):
        assert channel.curve is not None
        assert channel.curve.parameters == pytest.approx(made.curve.parameters, rel=1e-8)
        assert channel.largest_n == pytest.approx(made.largest_n, rel=1e-8)
    with pytest.raises(BadInput, match="does not exist yet"):
        write_calibration(tmp_path / "c.json", document)
    assert [path.name for path in tmp_path.iterdir()] == ["c.json"]


def test_any_changed_byte_of_a_value_is_noticed(document: dict[str, Any], tmp_path: Path) -> None:
    write_calibration(tmp_path / "c.json", document)
    text = (tmp_path / "c.json").read_text()
    places = [i for i, char in enumerate(text) if char.isdigit()][:: len(text) // 40]
    for place in places:
        other = "3" if text[place] != "3" else "4"
        (tmp_path / "c.json").write_text(text[:place] + other + text[place + 1 :])
        with pytest.raises(BadInput):
            read_calibration(tmp_path / "c.json")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "JSON"),
        ("[" * 100_000, "JSON"),
        ("[]", "another kind"),
        ('{"format": "taxel-calibration", "version": 2}', "version 2"),
        ('{"format": "taxel-calibration", "version": 1}', "check sum"),
        ('{"format": "taxel-calibration", "version": NaN}', "JSON"),
    ],
)
def test_other_files_are_refused(content: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "c.json").write_text(content)
    with pytest.raises(BadInput, match=says):
        read_calibration(tmp_path / "c.json")


def test_a_file_whose_check_holds_but_that_is_incomplete_is_refused(
    document: dict[str, Any], tmp_path: Path
) -> None:
    """Someone may compute the sum anew: fields are checked by themselves."""
    from taxel.calibration.stored import _digest

    broken = json.loads(json.dumps(document))
    broken["channels"][0]["curve"]["top_v"] = -1.0
    del broken["sha256"]
    write_calibration(tmp_path / "c.json", {**broken, "sha256": _digest(broken)})
    with pytest.raises(BadInput, match="rises"):
        read_calibration(tmp_path / "c.json")
