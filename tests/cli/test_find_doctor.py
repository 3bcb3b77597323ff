"""Claims about `taxel find` and `taxel doctor`: ready addresses, plain lines, honest exit codes."""

import errno
import json
import os
from pathlib import Path

import pytest

from taxel.cli.devices import doctor, find
from taxel.cli.extras import Extra
from taxel.cli.main import main
from taxel.errors import BadSource, MissingExtra
from taxel.sources.cameras import realsense_device
from taxel.sources.cameras.realsense_device import FoundRealSense
from taxel.sources.cameras.source import parse_cameras
from taxel.sources.cameras.v4l2_nodes import FoundCamera, Offer

LEFT = FoundCamera(
    path="/dev/video0",
    by_id="/dev/v4l/by-id/usb-GelSight_Mini_R0B_28T1-video-index0",
    card="GelSight Mini R0B 28T1",
    bus="usb-0000:00:14.0-1",
    serial="28T1",
    offers=(
        Offer("YUYV", 640, 480, (30.0,)),
        Offer("MJPG", 3280, 2464, (25.0,)),
        Offer("MJPG", 640, 480, (25.0, 10.0)),
    ),
)
RIGHT = FoundCamera(
    path="/dev/video2", card="GelSight Mini", offers=(Offer("MJPG", 3280, 2464, (25.0,)),)
)
SHUT = FoundCamera(path="/dev/video4", problem="permission denied")
BOARD = {
    "path": "/dev/ttyACM0",
    "by_id": "/dev/serial/by-id/usb-Arduino_7563",
    "serial": "7563",
    "vid_pid": "2341:0042",
    "product": "Mega 2560",
    "address": "serial:///dev/serial/by-id/usb-Arduino_7563",
}
OTHER = {
    **BOARD,
    "path": "/dev/ttyUSB0",
    "by_id": "",
    "serial": "",
    "address": "serial:///dev/ttyUSB0",
}


def test_each_camera_is_shown_with_number_lasting_name_and_what_it_offers_as_mjpg():
    lines = find.camera_lines([LEFT, SHUT])

    assert lines == [
        "cameras:",
        "  GelSight Mini R0B 28T1, serial number 28T1, usb-0000:00:14.0-1",
        f"    /dev/video0 = {LEFT.by_id}",
        "    MJPG 3280×2464 at 25; 640×480 at 25/10",
        "  /dev/video4: permission denied; run: taxel doctor",
    ]


def test_boards_are_shown_with_serial_number_and_lasting_name():
    lines = find.board_lines([BOARD, OTHER], [])

    assert lines[1:3] == [
        "  Mega 2560 (2341:0042), serial number 7563",
        "    /dev/ttyACM0 = /dev/serial/by-id/usb-Arduino_7563",
    ]
    assert lines[3:] == ["  Mega 2560 (2341:0042), serial number none", "    /dev/ttyUSB0"]


def test_addresses_open_each_device_and_all_together():
    """Both cameras at the one size that they share, by lasting names where there are any."""
    addresses = find.ready_addresses([BOARD, OTHER], [LEFT, RIGHT, SHUT])

    assert addresses == [
        "serial:///dev/serial/by-id/usb-Arduino_7563",
        "serial:///dev/ttyUSB0",
        "serial:///dev/serial/by-id/usb-Arduino_7563,/dev/ttyUSB0",
        f"camera://{LEFT.by_id}?width=640&height=480",
        "camera:///dev/video2?width=3280&height=2464",
        f"camera://{LEFT.by_id},/dev/video2?width=3280&height=2464",
    ]
    name = addresses[-1].removeprefix("camera://").partition("?")[0]
    assert parse_cameras(name, {}).paths == (LEFT.by_id, "/dev/video2")


def test_a_board_may_be_the_hand_s_and_the_line_below_the_addresses_names_what_opens_it(
    monkeypatch, capsys
):
    """No port is opened, so the hand's Mega looks like a sensor board; cameras need no line."""
    monkeypatch.setattr(find, "find_cameras", list)
    monkeypatch.setattr(find, "find_boards", lambda: ([BOARD, OTHER], []))
    main(["find"])
    last = capsys.readouterr().out.splitlines()[-1]
    assert "leave it out and open it with hand://PATH" in last

    monkeypatch.setattr(find, "find_boards", lambda: ([], []))
    monkeypatch.setattr(find, "find_cameras", lambda: [LEFT])
    main(["find"])
    assert "hand://" not in capsys.readouterr().out


def test_cameras_without_a_common_size_are_not_joined():
    small = FoundCamera(path="/dev/video6", offers=(Offer("MJPG", 320, 240, ()),))

    assert len(find.ready_addresses([], [RIGHT, small])) == 2
    assert find.shared_size([]) is None


def test_nothing_plugged_in_is_said_plainly(monkeypatch, capsys):
    monkeypatch.setattr(find, "find_boards", lambda: ([], []))
    monkeypatch.setattr(find, "find_cameras", list)
    main(["find"])
    printed = capsys.readouterr().out

    assert "boards: none." in printed
    assert "cameras: none." in printed
    assert "ready to use" not in printed


def test_a_missing_package_does_not_hide_the_cameras(monkeypatch, capsys):
    monkeypatch.setattr(find, "find_boards", lambda: ([], ["needed the package pyserial."]))
    monkeypatch.setattr(find, "find_cameras", lambda: [LEFT])
    main(["find"])
    printed = capsys.readouterr().out

    assert "boards: not looked for: needed the package pyserial." in printed
    assert f"'{LEFT.address}'" in printed


def test_a_scene_camera_is_a_line_and_an_address(monkeypatch, capsys):
    """One line each, and none where there are none or the extra is not installed."""
    monkeypatch.setattr(find, "find_boards", lambda: ([], []))
    monkeypatch.setattr(find, "find_cameras", list)
    found = [FoundRealSense("Intel RealSense D435I", "123622270224", "3.2")]
    monkeypatch.setattr(realsense_device, "list_realsense", lambda: found)
    main(["find"])
    printed = capsys.readouterr().out
    line = "scene camera: Intel RealSense D435I, serial number 123622270224, USB 3.2"
    assert printed.splitlines().count(line) == 1
    assert "  realsense://123622270224" in printed.splitlines()

    monkeypatch.setattr(realsense_device, "list_realsense", _not_installed)
    main(["find"])
    assert "scene camera" not in capsys.readouterr().out


def test_a_library_that_cannot_look_is_said_in_a_line(monkeypatch):
    def fail() -> None:
        raise BadSource("a machine where RealSense cameras can be looked for", "no USB", "x")

    monkeypatch.setattr(realsense_device, "list_realsense", fail)
    cameras, problems = find.find_scene_cameras()
    assert cameras == []
    (line,) = find.scene_lines(cameras, problems)
    assert line.startswith("scene cameras: not looked for: needed a machine where")


def _not_installed() -> None:
    raise MissingExtra("pyrealsense2", "realsense", "RealSense cameras")


def test_find_prints_json_of_the_machine_as_it_is(capsys):
    main(["find", "--json"])

    found = json.loads(capsys.readouterr().out)
    assert set(found) == {"boards", "cameras", "scene_cameras", "addresses", "problems"}
    assert len(found["addresses"]) >= len(
        [camera for camera in found["cameras"] if camera["address"]]
    )


def test_doctor_says_all_checks_as_json_and_ends_well_here(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(doctor, "FREE_BYTES", 1 << 20)
    monkeypatch.setattr(doctor, "SHARED_BYTES", 1 << 20)
    main(["doctor", "--json", "--output", str(tmp_path)])

    checks = json.loads(capsys.readouterr().out)
    assert all(set(check) == {"name", "ok", "found", "mend", "required"} for check in checks)
    assert {check["name"] for check in checks if check["required"]} == {
        "packages of the live path", "shared memory", "place for recordings",
    }  # fmt: skip
    assert list(tmp_path.iterdir()) == []


def test_optional_things_that_are_missing_do_not_fail(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(doctor, "FREE_BYTES", 1 << 20)
    monkeypatch.setattr(doctor, "SHARED_BYTES", 1 << 20)
    monkeypatch.setitem(doctor.EXTRAS, "gripper", Extra(("no_such_package",), "a gripper"))
    main(["doctor", "--output", str(tmp_path)])
    printed = capsys.readouterr().out

    assert "missing extra gripper, for a gripper: without no_such_package" in printed
    assert "run: pip install 'taxel[gripper]'" in printed
    assert "Live work can start: all required is there" in printed


def test_a_required_thing_that_is_missing_ends_with_code_1(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(doctor, "LIVE_PACKAGES", ("numpy", "no_such_package"))
    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--output", str(tmp_path)])

    assert ended.value.code == 1
    assert "Live work cannot start" in capsys.readouterr().out


def test_a_folder_that_is_none_is_bad_input(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--output", str(tmp_path / "none")])

    assert ended.value.code == 2
    assert "needed a folder for --output" in capsys.readouterr().err


def test_too_little_space_says_how_much_is_needed(tmp_path, monkeypatch):
    monkeypatch.setattr(doctor, "FREE_BYTES", 1 << 60)
    check = doctor.folder(tmp_path)

    assert (check.ok, check.required) == (False, True)
    assert check.mend.startswith("free 1152921505 GB")


def test_a_folder_that_takes_no_file_is_required_and_not_called_slow(tmp_path, monkeypatch, capsys):
    def refused(**_: object) -> object:
        raise OSError(errno.EDQUOT, "Disk quota exceeded")

    monkeypatch.setattr(doctor.tempfile, "TemporaryFile", refused)

    with pytest.raises(SystemExit) as ended:
        main(["doctor", "--output", str(tmp_path)])

    assert ended.value.code == 1
    text = " ".join(capsys.readouterr().out.split())
    assert "writing there: failed: disk quota exceeded; name another folder with --output" in text


def test_devices_without_permission_are_named(tmp_path, monkeypatch):
    """A node that may not be opened: the group is told, whoever runs the test."""
    (tmp_path / "ttyACM0").touch()
    (tmp_path / "ttyUSB1").touch()
    monkeypatch.setattr(doctor.os, "access", lambda node, mode: Path(node).name != "ttyACM0")
    check = doctor.device_nodes("dialout", ("ttyACM*", "ttyUSB*"), tmp_path)

    assert not check.ok
    assert "2 devices (ttyACM*, ttyUSB*), no permission for ttyACM0" in check.found
    assert check.mend == "run: sudo usermod -aG dialout $USER, then log in again"


def test_who_is_not_in_the_group_is_reported_before_a_device_is_plugged_in(tmp_path, monkeypatch):
    monkeypatch.setattr(doctor.os, "geteuid", lambda: 1000)
    monkeypatch.setattr(doctor, "_own_groups", lambda: {"users"})
    assert not doctor.device_nodes("video", ("video*",), tmp_path).ok
    monkeypatch.setattr(doctor, "_own_groups", lambda: {"users", "video"})
    assert doctor.device_nodes("video", ("video*",), tmp_path).ok


@pytest.mark.parametrize(("word", "ok"), [("performance", True), ("powersave", False), ("", True)])
def test_a_saving_processor_clock_is_reported(tmp_path, word: str, ok: bool):
    (tmp_path / "governor").write_text(word + "\n")
    assert doctor.governor(tmp_path / "governor").ok == ok


@pytest.mark.parametrize(("word", "ok"), [("tsc", True), ("kvm-clock", True), ("hpet", False)])
def test_a_slow_clock_is_reported(tmp_path, word: str, ok: bool):
    (tmp_path / "source").write_text(word + "\n")
    assert doctor.clock_source(tmp_path / "source").ok == ok


def test_one_core_is_too_few():
    assert [doctor.cores(count).ok for count in (1, 2)] == [False, True]


def test_shared_memory_that_is_absent_is_required(tmp_path):
    check = doctor.shared_memory(tmp_path / "none")

    assert (check.ok, check.required) == (False, True)


@pytest.mark.parametrize("permitted", [True, False])
def test_doctor_says_whether_alarms_may_run_before_other_work(permitted: bool):
    check = doctor.real_time(permitted)
    (line,) = [line for line in doctor.report([check]) if "real-time" in line]
    assert check.ok is permitted
    assert not check.required
    assert "permitted" in line
    assert ("not permitted" in line) is not permitted
    assert ("rtprio" in line) is not permitted


def test_doctor_tries_real_time_scheduling_and_leaves_this_process_as_it_was():
    before = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
    assert doctor.real_time().ok in (True, False)
    assert (os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)) == before
