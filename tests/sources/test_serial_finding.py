"""What `taxel find` is told of serial ports."""

from pathlib import Path

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from taxel.sources.boards.finding import list_boards


def port(device: Path, vid: int | None) -> ListPortInfo:
    found = ListPortInfo(str(device), skip_link_detection=True)
    found.vid, found.pid = vid, 0x0042
    found.serial_number, found.product = "5573", "Arduino Mega 2560"
    return found


def test_boards_are_listed_by_the_name_that_stays_and_mainboard_ports_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in ("ttyACM1", "ttyACM0", "ttyS0"):
        (tmp_path / name).touch()
    by_id = tmp_path / "by-id"
    by_id.mkdir()
    (by_id / "usb-Mega_5573-if00").symlink_to(tmp_path / "ttyACM1")
    ports = [
        port(tmp_path / "ttyACM1", 0x2341),
        port(tmp_path / "ttyACM0", 0x1A86),
        port(tmp_path / "ttyS0", None),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: ports)
    first, second = list_boards(by_id)
    assert (first["path"], first["by_id"]) == (str(tmp_path / "ttyACM0"), "")
    assert first["address"] == f"serial://{tmp_path}/ttyACM0"
    assert (second["vid_pid"], second["serial"]) == ("2341:0042", "5573")
    assert second["address"] == f"serial://{by_id}/usb-Mega_5573-if00"


def test_a_machine_without_boards_has_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(list_ports, "comports", list)
    assert list_boards(tmp_path / "none") == []
