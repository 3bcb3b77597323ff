"""`taxel calibrate` and `taxel flash` end to end: what they write, and what they refuse."""

import io
import json
import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.calibration.stored import read_calibration
from taxel.cli.main import main
from taxel.recordings.reader import read_recording
from taxel.sim.teng_hand import TengHandConfig
from taxel.sources.board_emulation import EmulatedBoard, RunningBoard
from taxel.sources.data_sets import write_sessions

FEW = ["--forces", "0.5", "1", "2", "4", "--rounds", "2"]
SIM = "sim://teng?seed=4&rate_hz=250"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration of the simulated hand, with its page and its raw recording."""
    from taxel.cli.calibrate import Calibrate

    folder = tmp_path_factory.mktemp("calibrated")
    Calibrate(
        source=(SIM,), output=folder / "c.json", html=folder / "c.html",
        recording=folder / "raw.mcap", forces=(0.5, 1.0, 2.0, 4.0), rounds=2,
    ).run()  # fmt: skip
    return folder


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run, and return the one line of a refusal."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        main(words)
    lines = capsys.readouterr().err.splitlines()
    assert end.value.code == 2, lines
    (line,) = [one for one in lines if one.startswith("taxel: ")]
    assert lines[-1] == line
    return line


def test_the_simulated_gauge_gives_a_curve_for_every_sensor_without_hardware(made: Path) -> None:
    calibration = read_calibration(made / "c.json")

    assert len(calibration.channels) == 12
    assert all(one.curve is not None for one in calibration.channels)
    page = (made / "c.html").read_text()
    assert page.count("data:image/png;base64,") == 5
    assert "http" not in page.replace("http-equiv", "")


def test_a_recording_with_marks_gives_the_curves_of_the_live_run(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    main(["calibrate", str(made / "raw.mcap"), "--output", str(tmp_path / "again.json"), "--json"])

    again = json.loads(capsys.readouterr().out)
    before = json.loads((made / "c.json").read_text())
    assert [one["curve"] for one in again["channels"]] == [
        pytest.approx(one["curve"], rel=1e-6) for one in before["channels"]
    ]
    assert again["made_from"][0]["sha256"]


def test_a_table_of_presses_says_what_marks_say(made: Path, tmp_path: Path) -> None:
    raw = read_recording(made / "raw.mcap")
    first_s = float(raw.samples.fitted_s[0])
    lines = ["sensor,force_n,start_s,end_s"]
    for number, mark in enumerate(one for one in raw.marks if "force_n" in one.labels):
        name = mark.labels["sensor"]
        if number % 2:  # by number as well as by name
            name = str(raw.manifest.sensor.channels.index(name) + 1)
        lines.append(f"{name},{mark.labels['force_n']},{mark.start_s - first_s},"
                     f"{mark.end_s - first_s}")  # fmt: skip
    (tmp_path / "presses.csv").write_text("\n".join(lines))

    main(["calibrate", str(made / "raw.mcap"), "--presses", str(tmp_path / "presses.csv"),
          "--output", str(tmp_path / "table.json")])  # fmt: skip

    mine = read_calibration(tmp_path / "table.json")
    for one, other in zip(mine.channels, read_calibration(made / "c.json").channels, strict=True):
        assert one.curve is not None
        assert other.curve is not None
        assert one.curve.volts(1.0) == pytest.approx(other.curve.volts(1.0), rel=1e-3)


def test_a_corrected_recording_names_its_calibration_and_leaves_the_raw_one_alone(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
                    "--output", str(tmp_path / "twice.mcap")], capsys)  # fmt: skip
    assert "corrected already" in line


def test_other_sensors_are_refused(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = TengHandConfig(seed=5, sessions=1, rate_hz=100.0, scans_per_class=600)
    write_sessions(tmp_path / "other", small, lambda _: None)

    other = str(tmp_path / "other" / "session-1.mcap")
    line = refused(["calibrate", other, "--apply", str(made / "c.json"),
                    "--output", str(tmp_path / "x.mcap")], capsys)  # fmt: skip

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
    words: list[str],
    says: str,
    made: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "bad.mcap").write_text("no recording\n" * 50)
    line = refused(["calibrate", *(one.format(made=made, tmp=tmp_path) for one in words)], capsys)

    assert says in line
    assert [one.name for one in tmp_path.iterdir()] == ["bad.mcap"]


def test_an_edited_calibration_is_refused(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = json.loads((made / "c.json").read_text())
    document["channels"][0]["curve"]["top_v"] *= 2
    (tmp_path / "edited.json").write_text(json.dumps(document))

    line = refused(["calibrate", str(made / "raw.mcap"), "--apply", str(tmp_path / "edited.json"),
                    "--output", str(tmp_path / "x.mcap")], capsys)  # fmt: skip

    assert "check sum" in line


def test_a_board_without_a_single_press_gives_no_calibration_and_keeps_the_raw_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The whole way from a port to the file, with a person who gives up at the first question."""
    monkeypatch.setattr("taxel.calibration.guided.REST_S", 0.3)
    monkeypatch.setattr("sys.stdin", io.StringIO("q\n"))
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(), path):
        line = refused(["calibrate", f"serial://{path}", "--output", str(tmp_path / "c.json"),
                        "--sensors", "b0-c2"], capsys)  # fmt: skip

    assert "presses of known force" in line
    assert sorted(one.name for one in tmp_path.iterdir()) == ["c.mcap"]
    raw = read_recording(tmp_path / "c.mcap")
    assert raw.statistics["lost_scans"] == 0
    assert len(raw.samples) > 1000  # the rest before, and a second after


# ---------------------------------------------------------------------------------- taxel flash


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Put real executables of the given names first on an otherwise empty PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))

    def put(*names: str, ends: int = 0, says: str = "") -> Path:
        log = tmp_path / "called"
        for name in names:
            file = folder / name
            file.write_text(
                f'#!/bin/sh\nprintf "%s" "{name}" >> {log}\n'
                f'for one in "$@"; do printf " [%s]" "$one" >> {log}; done\n'
                f'printf "\\n" >> {log}\necho "working"\necho "{says}" >&2\nexit {ends}\n'
            )
            file.chmod(file.stat().st_mode | stat.S_IXUSR)
        return log

    return put


@pytest.fixture
def sketches(tmp_path: Path) -> Path:
    """A firmware folder as the repository's: sketch, version, library."""
    for name in ("teng_daq", "hand_control"):
        (tmp_path / "firmware" / name).mkdir(parents=True)
        (tmp_path / "firmware" / name / f"{name}.ino").write_text("void setup() {}\n")
        (tmp_path / "firmware" / name / "board.c").write_text("x = { .firmware = {1, 0, 0}, };\n")
    (tmp_path / "firmware" / "libraries").mkdir()
    return tmp_path / "firmware"


def test_arduino_cli_builds_writes_and_the_board_says_hello(
    tools: Callable[..., Path],
    sketches: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tools("arduino-cli")
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(board=2, board_id="TENG-2"), path):
        main(["flash", "mega", "teng_daq", "--port", str(path), "--firmware", str(sketches),
              "--board-number", "2", "--board-id", "TENG-2", "--json"])  # fmt: skip

    said = json.loads(capsys.readouterr().out)
    assert (said["firmware"], said["board"], said["board_id"]) == ("1.0.0", 2, "TENG-2")
    compiled, uploaded = log.read_text().splitlines()
    assert compiled.startswith("arduino-cli [compile] [--fqbn] [arduino:avr:mega:cpu=atmega2560]")
    assert f"[--libraries] [{sketches / 'libraries'}]" in compiled
    assert "'-DTAXEL_BOARD=2' '-DTAXEL_BOARD_ID=\"TENG-2\"'" in compiled
    assert f"[--port] [{path}]" in uploaded


def test_avrdude_writes_a_built_file(
    tools: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tools("avrdude")
    (tmp_path / "mine.hex").write_text(":00000001FF\n")
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(board_id="EMU-0"), path):
        main(["flash", "mega", str(tmp_path / "mine.hex"), "--port", str(path)])

    assert "runs firmware 1.0.0" in capsys.readouterr().out
    assert log.read_text() == (
        f"avrdude [-p] [atmega2560] [-c] [wiring] [-P] [{path}] [-b] [115200] [-D] [-U] "
        f"[flash:w:{tmp_path / 'mine.hex'}:i]\n"
    )


def test_a_board_that_still_runs_something_else_is_told(
    tools: Callable[..., Path],
    sketches: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    tools("arduino-cli")
    path = tmp_path / "by-id-board"
    words = ["flash", "mega", "teng_daq", "--port", str(path), "--firmware", str(sketches)]
    with RunningBoard(EmulatedBoard(board=1), path):
        old = refused([*words, "--expect", "1.1.0"], capsys)
        other = refused([*words, "--board-number", "0"], capsys)

    assert "firmware 1.1.0" in old
    assert "firmware 1.0.0" in old
    assert "number 0" in other


def test_a_board_that_stays_silent_is_told(
    tools: Callable[..., Path],
    sketches: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    tools("arduino-cli")
    device, terminal = os.openpty()
    try:
        line = refused(["flash", "mega", "teng_daq", "--port", os.ttyname(terminal), "--firmware",
                        str(sketches), "--wait-s", "0.2"], capsys)  # fmt: skip
    finally:
        os.close(device)
        os.close(terminal)

    assert "0 bytes and no hello" in line


def test_a_tool_that_fails_gives_its_last_line(
    tools: Callable[..., Path],
    sketches: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tools("arduino-cli", ends=1, says="stk500v2_ReceiveMessage(): timeout")
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(), path):
        line = refused(["flash", "mega", "teng_daq", "--port", str(path), "--firmware",
                        str(sketches)], capsys)  # fmt: skip

    assert "exit code 1: stk500v2_ReceiveMessage(): timeout" in line
    assert len(log.read_text().splitlines()) == 1  # nothing is written after a failed build


def test_no_tool_no_port_and_a_held_port_are_one_line_each(
    tools: Callable[..., Path],
    sketches: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    import fcntl

    words = ["flash", "mega", "teng_daq", "--firmware", str(sketches), "--port"]
    assert "arduino-cli or avrdude" in refused([*words, str(tmp_path / "gone")], capsys)
    log = tools("arduino-cli")
    assert "no such device" in refused([*words, str(tmp_path / "gone")], capsys)
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(), path):
        held = os.open(path, os.O_RDWR | os.O_NOCTTY)
        try:
            fcntl.flock(held, fcntl.LOCK_EX)
            assert "another program holds it" in refused([*words, str(path)], capsys)
        finally:
            os.close(held)
    assert not log.exists()


@pytest.mark.slow
@pytest.mark.skipif(
    not all(map(shutil.which, ("make", "avr-gcc", "avr-objcopy")))
    or not Path("/usr/share/arduino/hardware/arduino/avr").is_dir(),
    reason="needs: apt install make gcc-avr avr-libc arduino-core-avr",
)
def test_the_repository_s_own_firmware_is_built_with_the_name_that_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Real make and compiler; only avrdude is replaced, by one that keeps what it is handed."""
    (tmp_path / "bin").mkdir()
    fake = tmp_path / "bin" / "avrdude"
    kept = tmp_path / "kept.hex"
    fake.write_text(
        f'#!/bin/sh\nfor one in "$@"; do case "$one" in flash:w:*:i) one="${{one#flash:w:}}"; '
        f'cp "${{one%:i}}" "{kept}";; esac; done\n'
    )
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(board=7, board_id="TENG-seven"), path):
        main(["flash", "mega", "teng_daq", "--port", str(path), "--board-number", "7",
              "--board-id", "TENG-seven", "--tool", "avrdude"])  # fmt: skip

    rows = kept.read_text().split()
    assert all(row.startswith(":") for row in rows)
    image = b"".join(bytes.fromhex(row[9:-2]) for row in rows if row[7:9] == "00")
    assert b"TENG-seven\0" in image


def test_dry_run_prints_commands_and_runs_none(
    tools: Callable[..., Path],
    sketches: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tools("avrdude", "make", "avr-gcc", "avr-objcopy")
    (sketches / "Makefile").write_text("all:\n")
    main(["flash", "mega", "teng_daq", "--port", "/dev/board", "--firmware", str(sketches),
          "--define", "TAXEL_RATE_HZ=500", "--dry-run"])  # fmt: skip

    make, objcopy, avrdude = capsys.readouterr().out.splitlines()
    assert make.startswith(f"make -C {sketches} BUILD=")
    assert "-DTAXEL_RATE_HZ=500" in make
    assert objcopy.startswith("avr-objcopy -O ihex")
    assert "-c wiring -P /dev/board -b 115200 -D -U flash:w:" in avrdude
    assert not log.exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["nothing_here"], "nothing_here"),
        (["gone.hex"], "gone.hex"),
        (["teng_daq", "--define", "A=1;rm -rf"], "--define"),
        (["teng_daq", "--board-id", "a b"], "--board-id"),
        (["teng_daq", "--board-number", "255"], "--board-number"),
        (["teng_daq", "--expect", "one"], "--expect"),
        (["teng_daq", "--tool", "avrdude"], "avrdude"),
        (["teng_daq", "--wait-s", "nan"], "--wait-s"),
    ],
)
def test_bad_words_to_flash_are_one_line(
    words: list[str],
    says: str,
    tools: Callable[..., Path],
    sketches: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tools("arduino-cli")
    line = refused(["flash", "mega", *words, "--port", "/dev/null", "--firmware", str(sketches)],
                   capsys)  # fmt: skip

    assert says in line
    assert not log.exists()
