"""`taxel power`: what the pads could give as a source of power, as an estimate.

Background of our choices: docs/decisions/0047.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import tyro
from rich.table import Table

from taxel.cli.printing import console, print_json, say
from taxel.errors import BadDataset, BadInput
from taxel.plain_text import number_of
from taxel.signals import Mark, Samples

if TYPE_CHECKING:
    from taxel.calibration.power import Circuit, PressPower

MOMENTS_S = (10.0, 60.0, 160.0, 200.0, 600.0, 3600.0)
"""Moments of the capacitor's curve, seconds; 160 and 200 s are those of the TENG thesis, section
2.2.2, the rest our choice, docs/decisions/0047."""
THESIS = (
    "the TENG thesis (2.2.2) quotes, of other pads: a tap every 2 s for 160 s gave 4.5 V and ran a "
    "watch for 15 s; 200 s of tapping ran it for 25 s"
)


@dataclass(frozen=True, kw_only=True)
class Power:
    """Estimate the charge and energy of each grasp, and how they would charge a capacitor.

    Computed from the voltages that the converter read; every assumption is printed.
    """

    source: tyro.conf.Positional[str]
    """A source in volts, such as sim://teng, or a recording's file."""
    seconds: float = 60.0
    """How much of the source is used, seconds of its own time."""
    capacitance_pf: float = 250.0
    """Assumed capacitance of a pad with its cable, pF."""
    time_constant_s: float = 0.16
    """Assumed resistance times capacitance at the converter's input, seconds."""
    storage_uf: float = 1.0
    """Capacitance of the capacitor that is charged, µF."""
    diode_v: float = 0.3
    """Voltage drop of each of the rectifier bridge's two conducting diodes, V."""
    json: bool = False
    """Print the result as JSON."""

    def run(self) -> None:
        """Read, estimate and print."""
        result = estimate_power(self.source, self.seconds, self._circuit())
        if self.json:
            print_json(result)
        else:
            _print(result)

    def _circuit(self) -> Circuit:
        from taxel.calibration.power import Circuit

        given = {
            "--seconds": self.seconds, "--capacitance-pf": self.capacitance_pf,
            "--time-constant-s": self.time_constant_s, "--storage-uf": self.storage_uf,
        }  # fmt: skip
        for name, value in given.items():
            if not 0 < value < math.inf:
                raise BadInput(f"{name} above 0", f"{value:g}", "choose another")
        if not 0 <= self.diode_v < math.inf:
            raise BadInput("--diode-v of at least 0", f"{self.diode_v:g}", "choose another")
        return Circuit(
            capacitance_pf=self.capacitance_pf,
            time_constant_s=self.time_constant_s,
            storage_uf=self.storage_uf,
            diode_v=self.diode_v,
        )


def estimate_power(address: str, seconds: float, circuit: Circuit) -> dict[str, Any]:
    """Return what a source's pads gave, as `--json` prints it.

    Raises:
        BadInput: The source does not read volts, or its presses are too quick to be followed.
        BadSource: It cannot be opened.
        BadDataset: It holds no presses.
    """
    from taxel.calibration.apply import rate_of
    from taxel.calibration.power import capacitor_curve, presses_of

    samples, marks, nominal_hz = _read(address, seconds)
    rate_hz = rate_of(samples, nominal_hz)
    presses = presses_of(samples, rate_hz, circuit)
    if not presses:
        raise BadDataset("presses that stand above rest",
                         f"none in {number_of(len(samples), 'scan')}",
                         "touch the pads, or look for longer with --seconds")  # fmt: skip
    seen_s = len(samples) / rate_hz
    try:
        volts = capacitor_curve(presses, seen_s, MOMENTS_S, circuit)
    except ValueError as error:
        raise BadInput("presses of some seconds or more", str(error),
                       "look for longer with --seconds") from error  # fmt: skip
    return _result(presses, marks, seen_s, volts.tolist(), circuit)


def _read(address: str, seconds: float) -> tuple[Samples, list[Mark], float]:
    """Return the scans, the grasps that lie within, and the nominal rate."""
    from taxel.cli.recordings.view import follow
    from taxel.sources.opening import at_full_speed, open_source

    parts: list[Samples] = []
    with open_source(at_full_speed(address)) as source:
        units = set(source.info.units)
        if units != {"V"}:
            raise BadInput("an array that reads volts", ", ".join(sorted(units)) or "none",
                           "give its raw recording")  # fmt: skip
        follow(source, seconds, parts.append)
        marks, nominal_hz = source.marks(), source.info.rate_hz
        nothing = Samples.empty(len(source.info.channels))
    samples = Samples.join([nothing, *parts])  # an empty recording ends before its first read
    if len(samples) < 10:
        raise BadDataset("10 scans", f"{len(samples)}", "look for longer with --seconds")
    return samples, [mark for mark in marks if mark.end_s <= samples.fitted_s[-1]], nominal_hz


def _result(
    presses: Sequence[PressPower],
    marks: Sequence[Mark],
    seconds: float,
    volts: Sequence[float],
    circuit: Circuit,
) -> dict[str, Any]:
    grasps = [
        [press for press in presses if mark.start_s - 0.1 <= press.at_s <= mark.end_s]
        for mark in marks
    ]
    energy_nj = sum(press.energy_nj for press in presses)
    return {
        "seconds": seconds,
        "presses": len(presses),
        "at_end": sum(press.at_end for press in presses),
        "press": _means([[press] for press in presses]),
        "grasps": len(grasps),
        "grasp": _means(grasps) if grasps else None,
        "power_nw": energy_nj / seconds,
        "storage_uf": circuit.storage_uf,
        "capacitor": [
            {
                "at_s": at_s,
                "volts": value,
                "energy_uj": 0.5 * circuit.storage_uf * value**2,
            }
            for at_s, value in zip(MOMENTS_S, volts, strict=True)
        ],
        "assumptions": [
            f"a pad with its cable has {circuit.capacitance_pf:g} pF, and R·C at the converter's "
            f"input is {circuit.time_constant_s:g} s",
            "the converter sees the positive half alone: charge until a press's peak, energy in "
            "its own input",
            f"each pad has a bridge of its own, whose two diodes take {circuit.diode_v:g} V each; "
            "a release gives as much as its press; nothing else leaks",
            f"presses go on as in these {seconds:.0f} s, into {circuit.storage_uf:g} µF that begin "
            "empty",
        ],
        "literature": THESIS,
    }


def _means(groups: Sequence[Sequence[PressPower]]) -> dict[str, float]:
    """Return mean charge and energy a group."""
    return {
        "charge_nc": sum(press.charge_nc for group in groups for press in group) / len(groups),
        "energy_nj": sum(press.energy_nj for group in groups for press in group) / len(groups),
    }


def _print(result: dict[str, Any]) -> None:
    least = " at least" if result["at_end"] else ""
    press, grasp = result["press"], result["grasp"]
    say(f"{number_of(result['presses'], 'press')} of pads in {result['seconds']:.0f} s, "
        f"{result['at_end']} at the converter's end: an estimate")  # fmt: skip
    say(f"a press of a pad:{least} {press['charge_nc']:.3g} nC, {press['energy_nj']:.3g} nJ")
    if grasp is not None:
        say(f"a grasp, all pads and presses ({number_of(result['grasps'], 'grasp')}):{least} "
            f"{grasp['charge_nc']:.3g} nC, {grasp['energy_nj']:.3g} nJ")  # fmt: skip
    say(f"power while this goes on: {result['power_nw']:.3g} nW")
    table = Table(
        title=f"a capacitor of {result['storage_uf']:g} µF", title_justify="left", box=None
    )
    for name in ("after s", "volts", "energy µJ"):
        table.add_column(name, justify="right")
    for row in result["capacitor"]:
        table.add_row(f"{row['at_s']:g}", f"{row['volts']:.3g}", f"{row['energy_uj']:.3g}")
    console.print(table)
    for line in result["assumptions"]:
        say(f"assumed: {line}")
    say(f"beside it: {result['literature']}")
