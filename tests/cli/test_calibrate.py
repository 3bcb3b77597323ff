"""`taxel calibrate` end to end: what it writes, and what it refuses."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.calibration.stored import read_calibration
from taxel.cli.main import main
from taxel.recordings.reader import read_recording
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.boards.emulation import EmulatedBoard, RunningBoard
from taxel.sources.simulated.data_sets import write_sessions

Refused = Callable[[list[str]], str]
SIM = "sim://teng?seed=4&rate_hz=250"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration of the simulated hand, with its page and its raw recording."""
    from taxel.cli.devices.calibrate import Calibrate

    folder = tmp_path_factory.mktemp("calibrated")
    Calibrate(
        source=(SIM,), output=folder / "c.json", html=folder / "c.html",
        recording=folder / "raw.mcap", forces=(0.5, 1.0, 2.0, 4.0), rounds=2,
    ).run()  # fmt: skip
    return folder


def test_the_simulated_gauge_gives_a_curve_for_every_sensor_without_hardware(made: Path) -> None:
    calibration = read_calibration(made / "c.json")

    assert len(calibration.channels) == 12
    assert all(channel.curve is not None for channel in calibration.channels)
    page = (made / "c.html").read_text()
    assert page.count("data:image/png;base64,") == 5
    assert "http" not in page.replace("http-equiv", "")


@pytest.mark.slow
def test_a_recording_with_marks_gives_the_curves_of_the_live_run(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    main(["calibrate", str(made / "raw.mcap"), "--output", str(tmp_path / "again.json"), "--json"])

    again = json.loads(capsys.readouterr().out)
    before = json.loads((made / "c.json").read_text())
    assert [channel["curve"] for channel in again["channels"]] == [
        pytest.approx(channel["curve"], rel=1e-6) for channel in before["channels"]
    ]
    assert again["made_from"][0]["sha256"]


@pytest.mark.slow
def test_a_table_of_presses_says_what_marks_say(made: Path, tmp_path: Path) -> None:
    raw = read_recording(made / "raw.mcap")
    first_s = float(raw.samples.fitted_s[0])
    lines = ["sensor,force_n,start_s,end_s"]
    for number, mark in enumerate(mark for mark in raw.marks if "force_n" in mark.labels):
        name = mark.labels["sensor"]
        if number % 2:  # by number as well as by name
            name = str(raw.manifest.sensor.channels.index(name) + 1)
        lines.append(f"{name},{mark.labels['force_n']},{mark.start_s - first_s},"
                     f"{mark.end_s - first_s}")  # fmt: skip
    (tmp_path / "presses.csv").write_text("\n".join(lines))

    main(["calibrate", str(made / "raw.mcap"), "--presses", str(tmp_path / "presses.csv"),
          "--output", str(tmp_path / "table.json")])  # fmt: skip

    mine = read_calibration(tmp_path / "table.json")
    for channel, other in zip(
        mine.channels, read_calibration(made / "c.json").channels, strict=True
    ):
        assert channel.curve is not None
        assert other.curve is not None
        assert channel.curve.volts(1.0) == pytest.approx(other.curve.volts(1.0), rel=1e-3)


def test_a_corrected_recording_names_its_calibration_and_leaves_the_raw_one_alone(
    made: Path, tmp_path: Path, refused: Refused
) -> None:
    before = (made / "raw.mcap").read_bytes()
    main(["calibrate", str(made / "raw.mcap"), "--apply", str(made / "c.json"), "--unit", "N",
          "--output", str(tmp_path / "newtons.mcap")])  # fmt: skip

    corrected = read_recording(tmp_path / "newtons.mcap")
    raw = read_recording(made / "raw.mcap")
    assert (made / "raw.mcap").read_bytes() == before
    digest = read_calibration(made / "c.json").digest
    assert corrected.manifest.sensor.details["calibration"] == digest
    assert corrected.manifest.sensor.units == ("N",) * 12
    assert corrected.marks == raw.marks
    assert (corrected.samples.counter == raw.samples.counter).all()
    line = refused(["calibrate", str(tmp_path / "newtons.mcap"), "--apply", str(made / "c.json"),
                    "--output", str(tmp_path / "twice.mcap")])  # fmt: skip
    assert "corrected already" in line


def test_other_sensors_are_refused(made: Path, tmp_path: Path, refused: Refused) -> None:
    small = TengHandConfig(seed=5, sessions=1, rate_hz=100.0, scans_per_class=600)
    write_sessions(tmp_path / "other", small, lambda _: None)

    other = str(tmp_path / "other" / "session-1.mcap")
    line = refused(["calibrate", other, "--apply", str(made / "c.json"),
                    "--output", str(tmp_path / "x.mcap")])  # fmt: skip

    assert "seed" in line
    assert not list(tmp_path.glob("x.mcap*"))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["{made}/raw.mcap", "--output", "{made}/c.json"], "--overwrite"),
        (["{made}/raw.mcap", "--output", "{tmp}/c.txt"], ".json"),
        (["{made}/none.mcap", "--output", "{tmp}/c.json"], "none.mcap"),
        (["{made}/raw.mcap", "--output", "{tmp}/c.json", "--html", "{tmp}/c.png"], ".html"),
        ([SIM, "--output", "{tmp}/c.json", "--forces", "1", "2"], "3 forces"),
        ([SIM, "--output", "{tmp}/c.json", "--forces", "nan", "1", "2", "3"], "forces"),
        ([SIM, "--output", "{tmp}/c.json", "--rounds", "0"], "--rounds"),
        ([SIM + "&shape=sphere", "--output", "{tmp}/c.json"], "shape"),
        (["sim://teng?wiring=two", "--output", "{tmp}/c.json"], "wiring"),
        (["sim://cup-pour", "--output", "{tmp}/c.json"], "sim://teng"),
        (["{tmp}/bad.mcap", "--output", "{tmp}/c.json"], "bad.mcap"),
        (["{made}/raw.mcap", "--output", "{tmp}/c.json", "--presses", "{tmp}/bad.mcap"], "column"),
        (["{made}/raw.mcap", "--apply", "{tmp}/bad.mcap", "--output", "{tmp}/x.mcap"], "JSON"),
        (["{made}/raw.mcap", "--apply", "{made}/c.json", "--output", "{made}/raw.mcap"], "raw"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    words: list[str], says: str, made: Path, tmp_path: Path, refused: Refused
) -> None:
    (tmp_path / "bad.mcap").write_text("no recording\n" * 50)
    line = refused(["calibrate", *(word.format(made=made, tmp=tmp_path) for word in words)])

    assert says in line
    assert [path.name for path in tmp_path.iterdir()] == ["bad.mcap"]


def test_an_edited_calibration_is_refused(made: Path, tmp_path: Path, refused: Refused) -> None:
    document = json.loads((made / "c.json").read_text())
    document["channels"][0]["curve"]["top_v"] *= 2
    (tmp_path / "edited.json").write_text(json.dumps(document))

    line = refused(["calibrate", str(made / "raw.mcap"), "--apply", str(tmp_path / "edited.json"),
                    "--output", str(tmp_path / "x.mcap")])  # fmt: skip

    assert "check sum" in line


def test_a_board_without_a_single_press_gives_no_calibration_and_keeps_the_raw_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    """The whole way from a port to the file, with a person who gives up at the first question."""
    monkeypatch.setattr("taxel.calibration.guided.REST_S", 0.3)
    monkeypatch.setattr("sys.stdin", io.StringIO("q\n"))
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(), path):
        line = refused(["calibrate", f"serial://{path}", "--output", str(tmp_path / "c.json"),
                        "--sensors", "b0-c2"])  # fmt: skip

    assert "presses of known force" in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.mcap"]
    raw = read_recording(tmp_path / "c.mcap")
    assert raw.statistics["lost_scans"] == 0
    assert len(raw.samples) > 1000  # the rest before, and a second after


def test_taps_of_the_simulated_gauge_give_wear_rates_and_both_times(tmp_path: Path) -> None:
    words = ["calibrate", f"{SIM}&fatigue=0.5", "--output", str(tmp_path / "d.json")]
    main([*words, "--cycles", "200", "--tap-hz", "0.5", "4"])
    document = json.loads((tmp_path / "d.json").read_text())

    (pad,) = document["channels"]
    assert pad["taps"] == 260
    assert pad["lost"][1] < 0.5 < pad["lost"][2]
    assert [round(row["tap_hz"], 1) for row in pad["by_rate"]] == pytest.approx(
        [0.5, 2.0, 4.0], abs=0.3
    )
    assert 0.0 < pad["response_s"][0] < 0.2
    assert 0.0 < pad["recovery_s"][0] < 0.2


def test_taps_in_a_recording_are_found_without_marks(made: Path, tmp_path: Path) -> None:
    """The gauge's presses are taps too: 16 on each pad are below the fewest, and that is said."""
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", str(made / "raw.mcap"), "--output", str(tmp_path / "d.json"),
              "--cycles", "20"])  # fmt: skip
    assert ended.value.code == 2
    assert not (tmp_path / "d.json").exists()


def test_a_sensor_that_is_not_there_is_refused_beside_taps(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", str(made / "raw.mcap"), "--output", str(tmp_path / "d.json"),
              "--cycles", "20", "--sensors", "thumb"])  # fmt: skip

    assert ended.value.code == 2
    line = capsys.readouterr().err
    assert line.startswith("taxel: needed --sensors among index-proximal, ")
    assert line.endswith("; got thumb; correct it.\n")


def test_taps_that_say_nothing_about_wear_get_a_line_instead_of_a_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(
        ["calibrate", SIM, "--output", str(tmp_path / "d.json"), "--cycles", "25", "--tap-hz", "4"]
    )
    pad = json.loads((tmp_path / "d.json").read_text())["channels"][0]

    assert pad["lost"] == [None, None, None]
    assert "no loss is stated, since its 95 % interval" in " ".join(capsys.readouterr().out.split())


def test_taps_without_a_source_are_refused_in_one_line(tmp_path: Path, refused: Refused) -> None:
    """It ended in a traceback."""
    line = refused(["calibrate", "--output", str(tmp_path / "x.json"), "--cycles", "100",
                    "--tap-hz", "1"])  # fmt: skip
    assert "sim://teng beside --tap-hz" in line
