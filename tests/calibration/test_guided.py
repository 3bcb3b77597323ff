"""Guided presses: a simulated gauge does what the terminal asks for, and the marks are right."""

import threading
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

from taxel.calibration.guided import asked_presses, find_press, record_presses
from taxel.clock import SystemClock
from taxel.errors import BadSource
from taxel.recordings.reader import read_recording
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
from taxel.sim.teng.hand import TengHandConfig

HAND = TengHandConfig(seed=0, rate_hz=200.0, humidity_pct=(50.0, 50.0))


class GaugeSource:
    """The simulated hand as a source: at rest, as fast as it is read, until it is pressed."""

    def __init__(self) -> None:
        self.gauge = ForceGauge(HAND, GaugeConfig(rest_s=0.8))
        self.wanted: list[tuple[int, float]] = []
        self.pressed = threading.Event()
        self.silent = False

    @property
    def info(self) -> SensorInfo:
        return self.gauge.info

    @property
    def cameras(self) -> tuple[CameraInfo, ...]:
        return ()

    @property
    def ended(self) -> bool:
        return self.silent

    def read(self, timeout_s: float = 0.1) -> Samples:
        if self.silent:
            return Samples.empty(12)
        if self.wanted:
            lead = self.gauge.rest(0.3)
            samples, _ = self.gauge.press(*self.wanted.pop())
            self.pressed.set()
            return Samples.join([lead, samples])
        threading.Event().wait(0.001)
        return self.gauge.rest(0.1)

    def frames(self) -> list[Frame]:
        return []

    def marks(self) -> list[Mark]:
        return []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        return None


class Hands:
    """Answers as a person would: presses what is asked for, then types what the gauge showed."""

    def __init__(self, source: GaugeSource, answers: list[str]) -> None:
        self.source, self.answers, self.messages = source, answers, []

    def ask(self, question: str) -> str:
        answer = self.answers.pop(0)
        if answer == "nothing":
            return ""
        if answer not in ("s", "q", "much"):
            name, force = question.split("press ")[1].split(" N,")[0].split(" with ")
            self.source.pressed.clear()
            self.source.wanted.append((self.source.info.channels.index(name), float(force)))
            assert self.source.pressed.wait(5.0)
            threading.Event().wait(0.02)  # the listener takes it in
        return answer


def test_presses_are_marked_where_they_were(tmp_path: Path) -> None:
    source = GaugeSource()
    hands = Hands(source, ["", "0.93", "much", "nothing", "", "s", "q"])
    asked = asked_presses([0, 4], [0.5, 1.0], rounds=1)

    made = record_presses(
        source, tmp_path / "raw.mcap", asked, hands.ask, hands.messages.append, SystemClock()
    )

    recording = read_recording(tmp_path / "raw.mcap")
    labels = [dict(mark.labels) for mark in recording.marks]
    assert made == 3
    assert [(label["sensor"], label["force_n"], label["direction"]) for label in labels] == [
        ("index-proximal", "0.5", "up"),
        ("index-proximal", "0.93", "up"),
        ("index-proximal", "1", "down"),
    ]
    assert any("newtons above 0" in line for line in hands.messages)
    assert any("no press seen on index-proximal" in line for line in hands.messages)
    samples = recording.samples
    for mark in recording.marks:
        inside = (samples.fitted_s >= mark.start_s) & (samples.fitted_s <= mark.end_s)
        assert samples.values[inside, 0].max() > 1.0
        assert 0.1 < mark.end_s - mark.start_s < 0.8
        before = (samples.fitted_s > mark.start_s - 0.2) & (samples.fitted_s < mark.start_s)
        assert samples.values[before, 0].max() < 0.2
    assert (samples.counter[1:] - samples.counter[:-1] == 1).all()  # nothing lost while asking


def test_the_end_of_the_input_ends_as_q_does_and_keeps_what_was_pressed(tmp_path: Path) -> None:
    source = GaugeSource()
    hands = Hands(source, [""])

    def ask(question: str) -> str:
        if not hands.answers:
            raise EOFError
        return hands.ask(question)

    asked = asked_presses([0], [0.5, 1.0], rounds=2)
    made = record_presses(
        source, tmp_path / "raw.mcap", asked, ask, hands.messages.append, SystemClock()
    )

    assert made == 1
    assert len(read_recording(tmp_path / "raw.mcap").marks) == 1


def test_a_source_that_ends_while_someone_types_is_reported(tmp_path: Path) -> None:
    source = GaugeSource()

    def ask(_: str) -> str:
        source.silent = True
        threading.Event().wait(0.05)
        return ""

    with pytest.raises(BadSource, match="its end"):
        record_presses(
            source,
            tmp_path / "raw.mcap",
            asked_presses([0], [1.0], 1),
            ask,
            lambda _: None,
            SystemClock(),
        )


def test_a_press_that_had_begun_before_the_question_is_not_taken() -> None:
    gauge = ForceGauge(HAND, GaugeConfig(rest_s=0.8))
    samples, mark = gauge.press(0, 1.0)

    assert find_press(samples[30:], 0, 200.0, 0.003) is None
    whole = Samples.join([gauge.rest(0.5), gauge.press(0, 1.0)[0]])
    assert find_press(whole, 0, 200.0, 0.003) is not None
    assert find_press(whole, 1, 200.0, 0.02) is None
    assert mark.labels["sensor"] == "index-proximal"


def test_every_sensor_is_pressed_up_and_down_in_every_round() -> None:
    forces = [(w.channel, w.force_n, w.rising, w.round) for w in asked_presses([3], [2.0, 1.0], 2)]

    assert forces == [
        (3, 1.0, True, 1), (3, 2.0, True, 1), (3, 2.0, False, 1), (3, 1.0, False, 1),
        (3, 1.0, True, 2), (3, 2.0, True, 2), (3, 2.0, False, 2), (3, 1.0, False, 2),
    ]  # fmt: skip
