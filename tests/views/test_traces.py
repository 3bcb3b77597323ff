"""Claims about the screen of raw touch and the figure: what they count, show and leave out."""

import io
import os

import numpy as np
import pytest
from rich.console import Console

from taxel.signals import Samples, SensorInfo, Validity
from taxel.views.keys import Keys
from taxel.views.trace_buffer import TraceBuffer, span_s
from taxel.views.traces import TraceScreen

HAND = tuple(
    f"{finger}-{phalanx}"
    for finger in ("index", "middle", "ring", "little")
    for phalanx in ("proximal", "middle", "distal")
)


def array(channels: tuple[str, ...], **other) -> SensorInfo:
    settings = {"units": ("V",) * len(channels), "rate_hz": 100.0, "full_scale": 3.3} | other
    return SensorInfo(name="skin", channels=channels, **settings)


def noise(scans: int, channels: int, start_s: float = 0.0, rate_hz: float = 100.0) -> Samples:
    values = np.random.default_rng(scans).uniform(0, 3, (scans, channels))
    return Samples.from_values(values, start_s + np.arange(scans) / rate_hz)


def drawn(screen: TraceScreen, width: int = 100, height: int = 30) -> list[str]:
    console = Console(width=width, height=height, record=True, file=io.StringIO())
    console.print(screen.render(width, height))
    return console.export_text().splitlines()


def test_lost_scans_are_gaps_of_the_counter_also_between_reads():
    buffer = TraceBuffer(array(("a",)), 4.0)
    whole = noise(100, 1)
    for part in (whole[:20], whole[23:50], whole[51:52], whole[60:]):
        buffer.add(part)
    assert (buffer.scans, buffer.lost) == (88, 3 + 1 + 8)


def test_a_restarted_counter_is_no_loss():
    buffer = TraceBuffer(array(("a",)), 4.0)
    buffer.add(noise(100, 1))
    buffer.add(noise(100, 1, start_s=2.0))
    assert buffer.lost == 0


def test_memory_holds_the_latest_seconds_and_the_ranges_all_of_it():
    buffer = TraceBuffer(array(("a",), full_scale=None), 2.0)
    for second in range(30):
        part = noise(100, 1, start_s=float(second))
        part.values[:] = second
        buffer.add(part)
        assert len(buffer.kept) <= 201  # each drawing asks for it
        assert sum(map(len, buffer._parts)) <= 201
    (channel,) = buffer.ranges()
    assert (channel.least, channel.most, channel.latest) == (0.0, 29.0, 29.0)


def test_the_rate_is_measured_and_not_the_nominal_one():
    buffer = TraceBuffer(array(("a",), rate_hz=60.0), 4.0)
    buffer.add(noise(80, 1, rate_hz=25.0))
    assert buffer.rate_hz == pytest.approx(25.0)


def test_flags_are_counted_by_scan_and_bad_values_are_no_range():
    buffer = TraceBuffer(array(("a", "b")), 4.0)
    samples = Samples.from_values(np.array([[1, 9], [np.nan, 1], [2, 1]]), np.arange(3.0), 3.3)
    samples.validity[2, 1] |= Validity.STALE
    buffer.add(samples)
    assert buffer.flags == {"stale": 1, "saturated": 1, "not finite": 1}
    first, second = buffer.ranges()
    assert (first.least, first.most, first.latest) == (1.0, 2.0, 2.0)
    assert (second.most, np.isnan(second.latest)) == (9.0, True)


def test_channels_of_one_unit_share_a_span_and_of_two_do_not():
    """Without a full scale: a silent channel looks silent beside a lively one of its unit."""
    info = array(("a", "b", "c"), units=("V", "V", "deg"), full_scale=None)
    buffer = TraceBuffer(info, 4.0)
    values = np.float32([[0, 10.0, 100], [2, 10.1, 190]])
    buffer.add(Samples.from_values(values, np.arange(2.0)))
    low, high = buffer.scale()
    np.testing.assert_allclose(low, [0, 10, 100])
    np.testing.assert_allclose(high - low, [2, 2, 90])


def test_a_slow_array_is_watched_for_longer():
    assert span_s(array(("a",), rate_hz=1000.0), 4.0) == 4.0
    assert span_s(array(("a",), rate_hz=1.0), 4.0) == 40.0
    assert span_s(array(("a",), rate_hz=0.0), 4.0) == 4.0


def test_the_screen_shows_every_channel_its_value_and_the_hands_map():
    screen = TraceScreen(array(HAND))
    samples = noise(500, 12)
    samples.values[-1] = np.arange(12) / 10
    screen.add(samples)
    lines = drawn(screen)
    assert lines[0].startswith("skin  100.0 scans/s (nominal 100)  500 scans")
    assert lines[1].startswith("0 lost  all values good")
    for column, name in enumerate(HAND):
        line = next(line for line in lines if line.startswith(name))
        assert f" {column / 10:.2f} V" in line
    text = "\n".join(lines)
    assert "index  middle ring   little" in text
    assert " 0.20   0.50   0.80   1.10" in text


@pytest.mark.parametrize("channels", [1, 5, 12, 17, 40, 64, 200])
@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40), (200, 60)])
def test_it_fits_the_terminal_whatever_the_array(channels: int, width: int, height: int):
    screen = TraceScreen(array(tuple(f"a-very-long-channel-{i}" for i in range(channels))))
    screen.add(noise(500, channels))
    lines = drawn(screen, width, height)
    assert len(lines) <= height
    assert max(map(len, lines)) <= width
    shown = sum(line.count("a-very-long") for line in lines)
    hidden = [int(line.split()[1]) for line in lines if line.startswith("and ")]
    assert shown + sum(hidden) == channels


@pytest.mark.parametrize("rate_hz", [0.0, 0.5, 5000.0])
def test_any_nominal_rate_can_be_drawn(rate_hz: float):
    screen = TraceScreen(array(("a", "b"), rate_hz=rate_hz))
    screen.add(noise(7, 2))
    assert any(line.startswith("b") for line in drawn(screen))


def test_a_value_that_may_not_be_used_is_a_dash():
    screen = TraceScreen(array(("a",)))
    samples = noise(50, 1)
    samples.validity[-1, 0] = Validity.MISSING
    screen.add(samples)
    line = next(line for line in drawn(screen) if line.startswith("a "))
    assert "– V" in line


def test_before_the_first_scan_it_says_so():
    screen = TraceScreen(array(("a",)))
    assert drawn(screen)[0].strip() == "skin: no scans yet"
    assert screen.summary()[0].startswith("skin  – scans/s")


def test_the_summary_has_a_line_a_channel():
    screen = TraceScreen(array(("a", "b")))
    samples = noise(50, 2)
    samples.values[:, 0] = 1.5
    samples.validity[:, 1] = Validity.MISSING
    screen.add(samples)
    assert screen.summary() == [
        "skin  100.0 scans/s (nominal 100)  50 scans",
        "0 lost  missing in 50 scans",
        "  a                       1.500 …      1.500 V, now 1.500",
        "  b                  no usable value",
    ]


@pytest.mark.parametrize("channels", [1, 12, 40])
def test_the_figure_is_a_png(channels: int):
    from taxel.views.figures.touch import touch_figure

    names = HAND if channels == 12 else tuple(f"c{i}" for i in range(channels))
    buffer = TraceBuffer(array(names, full_scale=None if channels == 1 else 3.3), 4.0)
    samples = noise(300, channels)
    samples.values[100:120, 0] = np.nan
    samples.validity[100:120, 0] = Validity.NOT_FINITE
    buffer.add(samples)
    assert touch_figure(buffer, "a title").startswith(b"\x89PNG")


def test_q_is_noticed_and_the_terminal_given_back():
    termios = pytest.importorskip("termios")
    keyboard, terminal = os.openpty()
    before = termios.tcgetattr(terminal)
    with os.fdopen(terminal, "r") as stream, Keys(stream) as key:
        assert not key.quit
        os.write(keyboard, b"x")
        assert not key.quit
        os.write(keyboard, b"q")
        assert key.quit
        assert not key.quit
        os.write(keyboard, b"\nd")
        assert not key.forget()
        assert key.typed() == ""
        os.write(keyboard, b"\nq")
        assert key.forget()
        key.__exit__(None, None, None)
        assert termios.tcgetattr(stream) == before
    os.close(keyboard)


def test_without_a_terminal_no_key_is_pressed(tmp_path):
    (tmp_path / "keys").write_text("q")
    with (tmp_path / "keys").open() as stream, Keys(stream) as key:
        assert not key.quit


@pytest.mark.parametrize(
    ("sent", "heard"),
    [
        (["\x1b[D"], ""),
        (["\x1b[A\x1b[B"], ""),
        (["\x1bOP", "\x1b[[A"], ""),
        (["\x1b[1;5Dq"], "q"),
        (["\x1b", "[", "D"], ""),
        (["\x1b[", "[A"], ""),
        (["\x1b[3", "~d"], "d"),
        (["\x1b", "q"], "q"),
        (["\x1b[3$", "d"], "d"),
        (["\x1bO5D"], ""),
        (["\x1b[99", "\x1b[A", "q"], "q"),
        (["aD\x1b[Hx"], "adx"),
    ],
)
def test_an_arrow_or_a_function_key_is_no_letter(sent: list[str], heard: str) -> None:
    """The arrow up acknowledged all alarms, that to the left disarmed, or discarded a recording."""
    pytest.importorskip("termios")
    controller, terminal = os.openpty()
    with os.fdopen(terminal, "r") as stream, Keys(stream) as key:
        found = ""
        for part in sent:
            os.write(controller, part.encode())
            found += key.typed()
        assert found == heard
    os.close(controller)
