"""`taxel calibrate --cycles`: tap a pad many times; wear, tap-rate curve, response and recovery.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl

import numpy as np
from rich.table import Table

from taxel import __version__
from taxel.cli.printing import console, print_json, progress, say, say_aside
from taxel.errors import BadDataset, BadInput, BadSource
from taxel.plain_text import finite, visible
from taxel.recordings.whole import write_whole
from taxel.signals import Samples, SensorInfo, Validity

if TYPE_CHECKING:
    from taxel.calibration.durability import Durability

FORMAT = "taxel-durability"
VERSION = 1
TAP_HZ = 2.0
"""Taps a second of the simulated gauge while wear is measured. Our choice, docs/decisions/0047."""
TAP_FORCE_N = 1.0
"""Of the simulated gauge. Our choice, docs/decisions/0047."""
TAPS_A_PAUSE = 50
"""Taps between two pauses, in which the baseline is measured anew. Our choice, 0047."""
TAPS_A_RATE = 30
"""Of the simulated gauge at each rate of the tap-rate curve. Our choice, docs/decisions/0047."""
_MOST_CYCLES = 1_000_000
_MOST_HZ = 20.0


def measure_cycles(
    address: str, sensors: Sequence[str], cycles: int, tap_hz: Sequence[float]
) -> dict[str, Any]:
    """Return what taps say of an array's channels, as the content of a file.

    Args:
        address: sim://teng, which the simulated gauge taps; any other source is tapped by whoever
            stands beside it; or a recording.
        sensors: Channels to look at; of sim://teng those that are tapped. All, or the first of the
            simulated ones, unless given.
        cycles: Taps on a channel after which to end; a recording is read to its end.
        tap_hz: Of sim://teng: rates of the tap-rate curve, taps a second.

    Raises:
        BadInput: A number lies outside its limits, or there is no such channel.
        BadSource: The source cannot be opened.
        BadDataset: Too few taps were found on every channel.
    """
    from taxel.calibration.durability import FEWEST, durability_of
    from taxel.calibration.taps import TapMeter

    _check(cycles, tap_hz)
    with ExitStack() as stack:
        if address.startswith("sim://"):
            info, blocks, columns = _simulated(address, sensors, cycles, tap_hz)
        else:
            info, blocks, columns = _from_source(address, sensors, stack)
        bar = stack.enter_context(progress())
        task = bar.add_task("taps", total=cycles)
        meters = {column: TapMeter(info.rate_hz) for column in columns}
        endless = not address.startswith("sim://") and not Path(_bare(address)).is_file()
        for samples in blocks:
            values = np.where(samples.usable, samples.values, np.nan).astype(np.float64)
            ends = (samples.validity & np.uint8(Validity.SATURATED)) != 0
            for column, meter in meters.items():
                meter.push(values[:, column], samples.fitted_s, ends[:, column])
            most = max(len(meter.taps) for meter in meters.values())
            bar.update(task, completed=min(most, cycles))
            if endless and most >= cycles:
                break
    channels = [
        durability_of(info.channels[column], meter.taps)
        for column, meter in meters.items()
        if len(meter.taps) >= FEWEST
    ]
    if not channels:
        raise BadDataset(
            f"{FEWEST} taps on a channel, after 2 s without touch",
            f"at most {max(len(meter.taps) for meter in meters.values())}",
            "tap one pad firmly and let go each time",
        )
    return _document(address, info, channels)


def write_cycles(path: Path, document: dict[str, Any], as_json: bool) -> None:
    """Write the file, and show what it says."""
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(path, text.encode())
    if as_json:
        print_json(document)
        return
    table = Table(title=str(path), title_justify="left", padding=(0, 1), box=None)
    for name in ("channel", "taps", "at end", "lost in 10,000 taps", "response ms", "recovery ms"):
        table.add_column(name, justify="left" if name == "channel" else "right", no_wrap=True)
    for channel in document["channels"]:
        table.add_row(
            visible(channel["channel"]), f"{channel['taps']:,}", f"{channel['at_end']:,}",
            _with_ends(channel["lost"], 100.0, "{:.1f}", " %"),
            _with_ends(channel["response_s"], 1000.0, "{:.0f}"),
            _with_ends(channel["recovery_s"], 1000.0, "{:.0f}"),
        )  # fmt: skip
    console.print(table)
    for channel in document["channels"]:
        rates = ", ".join(
            f"{row['tap_hz']:.2g} Hz {row['height'][0]:.3g} ({row['taps']})"
            for row in channel["by_rate"]
        )
        say(f"{visible(channel['channel'])}: height by rate, {document['unit']} (taps): {rates}")
    for line in document["notes"]:
        say(line)


def _check(cycles: int, tap_hz: Sequence[float]) -> None:
    from taxel.calibration.durability import FEWEST

    if not FEWEST <= cycles <= _MOST_CYCLES:
        raise BadInput(f"--cycles within {FEWEST} and {_MOST_CYCLES}", str(cycles),
                       "choose another")  # fmt: skip
    if not all(math.isfinite(rate) and 0.05 <= rate <= _MOST_HZ for rate in tap_hz):
        raise BadInput(
            f"--tap-hz within 0.05 and {_MOST_HZ:g}", " ".join(f"{rate:g}" for rate in tap_hz),
            "for example --tap-hz 0.5 1 2 4 8",
        )  # fmt: skip


_Blocks = tuple[SensorInfo, Iterator[Samples], list[int]]


def _simulated(
    address: str, sensors: Sequence[str], cycles: int, tap_hz: Sequence[float]
) -> _Blocks:
    """Return the simulated hand under a gauge that taps."""
    from taxel.calibration.taps import PAUSE_S
    from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
    from taxel.sources.simulated.teng_options import parse_options

    name, _, query = address.removeprefix("sim://").partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    options.pop("speed", None)
    if name != "teng" or options.keys() & {"shape", "seconds"}:
        raise BadSource("sim://teng without shape and seconds", address, "mend the address")
    hand, choice = parse_options(options)
    gauge = ForceGauge(hand, GaugeConfig(material=choice.material or "plastic"))
    columns = _columns(gauge.info, sensors or gauge.info.channels[:1])

    def blocks() -> Iterator[Samples]:
        yield gauge.rest(3.0)
        for column in columns:
            for rate, taps in [(TAP_HZ, cycles), *((rate, TAPS_A_RATE) for rate in tap_hz)]:
                for number in range(taps):
                    if number % TAPS_A_PAUSE == 0:
                        yield gauge.rest(PAUSE_S + 0.5)
                    yield gauge.tap(column, TAP_FORCE_N, rate)
            yield gauge.rest(1.0)

    return gauge.info, blocks(), columns


def _from_source(address: str, sensors: Sequence[str], stack: ExitStack) -> _Blocks:
    """Return a source, or a recording at full speed."""
    from taxel.sources.opening import at_full_speed, open_source

    source = stack.enter_context(open_source(at_full_speed(address)))
    if not Path(_bare(address)).is_file():
        say_aside(
            "hands off for 2 s; then tap the pads, letting go each time, with 2 s of pause after "
            "every 50 taps or so; Ctrl-C ends too"
        )

    def blocks() -> Iterator[Samples]:
        try:
            while not source.ended:
                samples = source.read()
                if len(samples):
                    yield samples
        except KeyboardInterrupt:
            say_aside("stopped; what was tapped so far counts")

    return source.info, blocks(), _columns(source.info, sensors or source.info.channels)


def _columns(info: SensorInfo, sensors: Sequence[str]) -> list[int]:
    odd = [name for name in sensors if name not in info.channels]
    if odd:
        raise BadInput(
            f"--sensors among {', '.join(map(visible, info.channels))}", visible(odd[0]),
            "correct it",
        )  # fmt: skip
    return list(info.indices(tuple(sensors)))


def _bare(address: str) -> str:
    return address.removeprefix("replay://").partition("?")[0]


def _document(address: str, info: SensorInfo, found: Sequence[Durability]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "software": f"taxel {__version__}",
        "source": address,
        "sensor": {"name": info.name, "serial": info.serial},
        "unit": _unit(info, [each.channel for each in found]),
        "channels": [finite(asdict(channel)) for channel in found],
        "notes": [
            *_not_stated(found),
            "lost: by a straight line through the logarithms of the heights of the commonest "
            "rate's taps, stated for 10,000 taps; below 0 is a gain; 95 % in brackets",
            "response 10 to 90 % and recovery 90 to 10 %: median and quartiles; they include "
            "the speed of the finger or machine that taps",
        ],
    }


def _unit(info: SensorInfo, channels: Sequence[str]) -> str:
    """Return the unit of the heights of these channels, of which an array may have several."""
    units = dict.fromkeys(info.units[column] for column in info.indices(tuple(channels)))
    return next(iter(units)) if len(units) == 1 else ", ".join(units)


def _not_stated(found: Sequence[Durability]) -> list[str]:
    """Return a line on channels whose loss is too uncertain to be stated, if there are any."""
    names = [each.channel for each in found
             if math.isfinite(each.first) and not math.isfinite(each.lost[0])]  # fmt: skip
    if not names:
        return []
    return [
        f"{', '.join(map(visible, names))}: no loss is stated, since its 95 % interval for 10,000 "
        "taps would be wider than 200 points: tap more often, always with the same force"
    ]


def _with_ends(ends: Sequence[float | None], factor: float, form: str, unit: str = "") -> str:
    if any(end is None for end in ends):
        return "–"
    middle, low, high = (form.format(factor * (end or 0.0)) for end in ends)
    return f"{middle}{unit} [{low}, {high}]"
