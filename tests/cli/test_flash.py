"""`taxel flash` end to end: the commands it gives, what it asks the board, what it refuses."""

import fcntl
import json
import os
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.sources.boards.emulation import EmulatedBoard, RunningBoard

Refused = Callable[[list[str]], str]
Tools = Callable[..., Path]


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tools:
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
    tools: Tools, sketches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tools("arduino-cli")
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(board=2, board_id="TENG-2"), path):
        main(["flash", "mega", "teng_daq", "--port", str(path), "--firmware", str(sketches),
              "--board-number", "2", "--board-id", "TENG-2", "--json"])  # fmt: skip

    answer = json.loads(capsys.readouterr().out)
    assert (answer["firmware"], answer["board"], answer["board_id"]) == ("1.0.0", 2, "TENG-2")
    compiled, uploaded = log.read_text().splitlines()
    assert compiled.startswith("arduino-cli [compile] [--fqbn] [arduino:avr:mega:cpu=atmega2560]")
    assert f"[--libraries] [{sketches / 'libraries'}]" in compiled
    assert "'-DTAXEL_BOARD=2' '-DTAXEL_BOARD_ID=\"TENG-2\"'" in compiled
    assert f"[--port] [{path}]" in uploaded


def test_after_the_hand_s_firmware_the_next_command_opens_a_hand(
    tools: Tools, sketches: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tools("arduino-cli")
    path = tmp_path / "by-id-board"
    hand = RunningBoard(EmulatedBoard(board=3, board_id="HAND", channels=0), path)
    hand.pause()  # it sends no scans
    with hand:
        main(["flash", "mega", "hand_control", "--port", str(path), "--firmware", str(sketches)])

    assert capsys.readouterr().out.splitlines()[-1] == f"next:  taxel hand status 'hand://{path}'"


def test_avrdude_writes_a_built_file(
    tools: Tools, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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


def test_a_board_that_still_runs_something_else_is_reported(
    tools: Tools, sketches: Path, tmp_path: Path, refused: Refused
) -> None:
    tools("arduino-cli")
    path = tmp_path / "by-id-board"
    words = ["flash", "mega", "teng_daq", "--port", str(path), "--firmware", str(sketches)]
    with RunningBoard(EmulatedBoard(board=1), path):
        old = refused([*words, "--expect", "1.1.0"])
        other = refused([*words, "--board-number", "0"])

    assert "firmware 1.1.0" in old
    assert "firmware 1.0.0" in old
    assert "number 0" in other


def test_a_board_that_stays_silent_is_reported(
    tools: Tools, sketches: Path, tmp_path: Path, refused: Refused
) -> None:
    tools("arduino-cli")
    device, terminal = os.openpty()
    try:
        line = refused(["flash", "mega", "teng_daq", "--port", os.ttyname(terminal), "--firmware",
                        str(sketches), "--wait-s", "0.2"])  # fmt: skip
    finally:
        os.close(device)
        os.close(terminal)

    assert "0 bytes and no hello" in line


def test_a_tool_that_fails_gives_its_last_line(
    tools: Tools, sketches: Path, tmp_path: Path, refused: Refused
) -> None:
    log = tools("arduino-cli", ends=1, says="stk500v2_ReceiveMessage(): timeout")
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(), path):
        line = refused(["flash", "mega", "teng_daq", "--port", str(path), "--firmware",
                        str(sketches)])  # fmt: skip

    assert "exit code 1: stk500v2_ReceiveMessage(): timeout" in line
    assert len(log.read_text().splitlines()) == 1  # nothing is written after a failed build


def test_no_tool_no_port_and_a_held_port_are_one_line_each(
    tools: Tools, sketches: Path, tmp_path: Path, refused: Refused
) -> None:
    words = ["flash", "mega", "teng_daq", "--firmware", str(sketches), "--port"]
    assert "arduino-cli or avrdude" in refused([*words, str(tmp_path / "gone")])
    log = tools("arduino-cli")
    assert "no such device" in refused([*words, str(tmp_path / "gone")])
    path = tmp_path / "by-id-board"
    with RunningBoard(EmulatedBoard(), path):
        held = os.open(path, os.O_RDWR | os.O_NOCTTY)
        try:
            fcntl.flock(held, fcntl.LOCK_EX)
            assert "another program holds it" in refused([*words, str(path)])
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
    tools: Tools, sketches: Path, capsys: pytest.CaptureFixture[str]
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
    words: list[str], says: str, tools: Tools, sketches: Path, refused: Refused
) -> None:
    log = tools("arduino-cli")
    words = ["flash", "mega", *words, "--port", "/dev/null", "--firmware", str(sketches)]
    line = refused(words)

    assert says in line
    assert not log.exists()
