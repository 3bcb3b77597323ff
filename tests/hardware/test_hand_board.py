"""The hand's firmware on an emulated board with motors and current sensors, in virtual time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from taxel.actions.bus_worker import Command
from taxel.actions.collecting import collect_grasp
from taxel.actions.hand_driver import HandDriver, hand_limits
from taxel.actions.hand_link import Grip, HandConfig, HandLink
from taxel.bench.boards.collect import CYCLE
from taxel.bench.boards.emulator import BoardSetup, EmulatedBoards, Firmware, VirtualClock
from taxel.bench.boards.grasping_boards import GraspingBoards
from taxel.bench.boards.hand import (
    CONTACT_MA,
    MOTORS,
    VirtualHost,
    drill,
    hand_setup,
    running,
)
from taxel.recordings.reader import read_recording
from taxel.recordings.trial_plan import PlannedTrial
from taxel.wire.messages import Ability, Acknowledge, Current, Hello, Order, Result, State


@pytest.mark.parametrize(
    ("name", "limit_ms", "state"),
    [
        ("contact", 10.0, State.MOVING),
        ("silence", 100.0, State.STOPPED),
        ("silent", 10.0, State.FAULT),
        ("hangs", 10.0, State.FAULT),
        ("low", 10.0, State.FAULT),
        ("power", 10.0, State.FAULT),
        ("over-current", 10.0, State.FAULT),
        ("stop", 10.0, State.STOPPED),
        ("hang 0", 100.0, State.IDLE),
        ("hang 1", 100.0, State.IDLE),
    ],
)
def test_motors_are_off_in_time(firmware: Firmware, name: str, limit_ms: float, state: State):
    """Contact: that finger alone. hang: the chip's watchdog restarts a program that hangs."""
    found = drill(firmware, name, 3 if name == "contact" else 1, seed=7)
    assert 0.0 < found.worst_ms <= limit_ms
    assert found.state == state


def test_the_hand_says_who_it_is_and_what_its_motors_draw(firmware: Firmware):
    with EmulatedBoards(firmware, [hand_setup(firmware)]) as boards, VirtualHost(boards) as host:
        host.order(Order.IDENTIFY)
        host.ready()
        host.close_fingers(0.3)
    hello = next(m for m in host.heard if isinstance(m, Hello))
    assert hello.abilities == Ability.CURRENTS | Ability.MOTION
    assert (hello.board_id, hello.channels) == ("HAND", 0)
    newest = [m for m in host.heard if isinstance(m, Current)][-1]
    assert newest.milliamps == pytest.approx([300] * MOTORS, abs=2)


def test_with_the_thesis_single_sensor_contact_of_one_finger_stops_all(firmware: Firmware):
    setup = BoardSetup(elf=firmware.elf("hand_control_1"), sensors=1)
    with EmulatedBoards(firmware, [setup]) as boards, VirtualHost(boards) as host:
        host.ready()
        host.order(Order.GRIP, 1000, 0b0011, 1000, 1200)  # two fingers run at 600 mA together
        host.run(0.25)
        assert running(boards) == {0, 1}
        boards.command("contact 0 1 1")
        touched_s = boards.now_s
        host.run(0.02)
        assert running(boards) == set()
        assert max(e.at_s for e in boards.events if e.what == "motor") - touched_s <= 0.01


def test_a_hand_whose_sensors_fail_arms_only_when_they_are_back(firmware: Firmware):
    with EmulatedBoards(firmware, [hand_setup(firmware)]) as boards, VirtualHost(boards) as host:
        boards.command("i2c 0 hangs")
        host.run(0.1)
        refused = host.order(Order.ARM)
        host.run(0.02)
        boards.command("i2c 0 good")
        host.run(0.1)
        taken = host.order(Order.ARM)
        host.run(0.02)
        assert host.result(refused) == Result.NOT_ARMED
        assert host.result(taken) == Result.DONE


def test_a_grip_that_nobody_refreshes_runs_out_and_is_acknowledged_twice(firmware: Firmware):
    with EmulatedBoards(firmware, [hand_setup(firmware)]) as boards, VirtualHost(boards) as host:
        host.ready()
        number = host.grip(lasts_ms=150)
        host.run(0.1)
        assert running(boards) == set(range(MOTORS))
        host.run(0.1)
        assert running(boards) == set()
        answers = [m for m in host.heard if isinstance(m, Acknowledge) and m.command_seq == number]
        assert [m.result for m in answers] == [Result.DONE, Result.EXPIRED]
        assert host.state == State.ARMED


def test_noise_on_the_line_moves_nothing_and_does_not_keep_a_silent_host_alive(firmware: Firmware):
    with EmulatedBoards(firmware, [hand_setup(firmware)]) as boards, VirtualHost(boards) as host:
        host.ready()
        host.close_fingers()
        last_s = boards.now_s
        for number in range(40):
            host.send_bytes(bytes((37 * number + i * i) % 256 for i in range(50)))
            host.run(0.005, beats=False)
        assert running(boards) == set()
        assert host.state == State.STOPPED
        offs = [event.at_s for event in boards.events if event.what == "motor"][-MOTORS:]
        assert max(offs) - last_s <= 0.1


def test_the_hosts_own_link_arms_closes_and_stops_the_hand(firmware: Firmware):
    """`HandLink` is what the live station uses; here it runs on the boards' virtual time."""
    with EmulatedBoards(firmware, [hand_setup(firmware)]) as boards:
        clock = VirtualClock(boards)
        link = HandLink(HandConfig(port=str(boards.port(0))), clock)
        link.open()

        def live(seconds: float) -> None:
            until_s = clock.now_s() + seconds
            while clock.now_s() < until_s:
                link.owner_s = clock.now_s()
                link.look()
                clock.sleep(0.002)

        live(0.1)
        link.arm_wanted = True
        live(0.1)
        assert link.state == State.ARMED
        link.grip = Grip(0b0011, 1000, CONTACT_MA, 300)
        link.do(Command("grip", expires_s=clock.now_s() + 0.3))
        live(0.2)
        assert running(boards) == {0, 1}
        assert link.state == State.MOVING
        assert link.currents_ma[0] == pytest.approx(300, abs=2)
        boards.command("contact 0 0 1")
        live(0.02)
        assert running(boards) == {1}
        link.do(Command("stop"))
        live(0.05)
        assert running(boards) == set()
        assert (link.state, link.fault) == (State.STOPPED, "")
        link.shut()


@pytest.mark.slow
def test_the_emulated_hand_grasps_labels_and_records_and_its_motors_stop_at_contact(
    firmware: Firmware, tmp_path: Path
):
    """Pads, motors, serial lines and drivers as in a lab; the object is simulated between them."""
    trial = PlannedTrial(
        number=1, labels={"shape": "sphere", "material": "aluminium"}, groups={"session": "a"}
    )
    with GraspingBoards(firmware) as rig:
        source, actuator = rig.open()
        driver = HandDriver(actuator, rig, hand_limits(CYCLE.contact_ma))
        driver.arm()
        rig.plant.begin_session("a")
        rig.plant.present("sphere", "aluminium", 1)
        grasp = collect_grasp(source, driver, trial, tmp_path, replace(CYCLE, presses=1))
        off_ms = rig.contact_to_off_ms()
    recording = read_recording(tmp_path / trial.file_name)
    (mark,) = recording.marks
    inside = (recording.samples.fitted_s >= mark.start_s) & (
        recording.samples.fitted_s <= mark.end_s
    )

    assert grasp.touched == (1, 2, 3, 4)
    assert len(off_ms) == MOTORS
    assert max(off_ms) <= 10.0
    assert dict(recording.manifest.labels) == trial.labels
    assert recording.samples.values[inside].max() > 1.0
    assert recording.samples.values[~inside].max() < 1.0
