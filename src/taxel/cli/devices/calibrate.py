"""`taxel calibrate`: known forces in, a force-to-voltage curve a sensor out; and its use.

Background of our choices: docs/decisions/0022.
"""

from __future__ import annotations

import math
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal
from urllib.parse import parse_qsl

import tyro
from rich.table import Table

from taxel.cli.options.rules import Only
from taxel.cli.printing import ask, command, console, print_json, say, say_aside
from taxel.clock import SystemClock
from taxel.errors import BadInput, BadSource, MissingExtra
from taxel.foreign.files import sha256_of
from taxel.plain_text import number_of
from taxel.recordings.reader import read_recording
from taxel.signals import Samples, SensorInfo

if TYPE_CHECKING:
    from taxel.calibration.results import PressedRecording

FORCES_N = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
"""0.5 to 5 N as in the TENG thesis, section 3.4; the steps are our choice."""


@dataclass(frozen=True, kw_only=True)
class Calibrate:
    """Measure sensors' response to known forces, and correct later recordings with it.

    From recordings whose marks carry the labels sensor and force_n, or with a table of presses;
    from a board, asking for each press on the terminal; or, without hardware, from
    sim://teng under a simulated force gauge. With --apply CALIBRATION recordings are corrected
    instead: baseline and drift taken away, volts turned into newtons where asked.
    """

    source: tyro.conf.Positional[tuple[str, ...]]
    """Recordings (.mcap) of one array, or one address: sim://teng, serial://…"""
    output: Path
    """The calibration to write (.json); with --apply the corrected recording (.mcap)."""
    presses: tuple[Path, ...] = ()
    """Tables of presses (CSV: sensor, force_n, start_s, end_s; and where known direction, round,
    reference_v), one a recording, times in s since its first scan; instead of marks."""
    measure: Literal["peak", "plateau"] = "peak"
    """Where a press is read: at its peak (sensors that respond to a change), or in its middle
    (sensors that hold their value)."""
    forces: tuple[float, ...] = FORCES_N
    """Live: forces to ask for, N."""
    rounds: int = 3
    """Live: rounds of rising and falling forces, on each sensor."""
    sensors: tuple[str, ...] = ()
    """Live: channels to press; all unless given. With --cycles: channels to evaluate; with
    sim://teng, channels that the gauge taps, the first unless given."""
    cycles: int | None = None
    """Measure durability instead of curves, over this many taps, which are detected automatically.
    With sim://teng the simulated gauge taps, otherwise a person or a machine."""
    tap_hz: tuple[float, ...] = (0.5, 1.0, 4.0, 8.0)
    """With --cycles and sim://teng: further rates of tapping, 1/s; real taps may have any rate."""
    recording: Path | None = None
    """Live: where the raw recording goes; beside --output unless given. sim://teng keeps none
    unless this is given."""
    html: Path | None = None
    """Write the characterisation as a page with figures."""
    apply: Path | None = None
    """A calibration (.json) to correct the recording by."""
    unit: Literal["V", "N"] = "V"
    """With --apply: corrected volts (or what else the array's unit is), or newtons."""
    seed: int = 0
    """Seed of the resampling for the intervals."""
    overwrite: bool = False
    """Replace existing files."""
    json: bool = False
    """Print the calibration, or the ledger of the corrected recording, as JSON."""

    RULES: ClassVar = (
        Only(
            ("measure", "presses", "html", "seed"), "no --apply and no --cycles",
            lambda o: o.apply is None and o.cycles is None,
        ),
        Only(("unit",), "--apply", lambda o: o.apply is not None),
        Only(("apply",), "no --cycles", lambda o: o.cycles is None),
        Only(
            ("forces", "rounds", "recording"), "a live sensor or sim://teng, and no --cycles",
            lambda o: o._live() and o.cycles is None,
        ),
        Only(
            ("sensors",), "a live sensor, or --cycles",
            lambda o: o.cycles is not None or (o._live() and not o._is_simulated()),
        ),
        Only(
            ("tap-hz",), "--cycles and sim://teng",
            lambda o: o.cycles is not None and o._is_simulated(),
        ),
    )  # fmt: skip

    def run(self) -> None:
        """Calibrate, or correct."""
        if not self.source:
            raise BadInput("a recording or an address", "none", "try: taxel calibrate sim://teng")
        if self.apply is not None:
            self._correct(self.apply)
            return
        if self.cycles is not None:
            self._tap(self.cycles)
            return
        _need_scipy()
        from taxel.calibration.characterise import characterise
        from taxel.calibration.report import write_page
        from taxel.calibration.stored import check_output, document_of, write_calibration

        check_output(self.output, self.overwrite)
        self._check_options()
        taken, sensor, made_from = self._taken()
        found = characterise(taken, sensor, self.measure, self.seed)
        document = document_of(found, made_from, {"measure": self.measure, "seed": self.seed})
        if self.html is not None:
            write_page(self.html, document, shlex.join(["taxel", *sys.argv[1:]]))
        write_calibration(self.output, document, self.overwrite)
        if self.json:
            print_json(document)
        else:
            self._print(document)

    def _tap(self, cycles: int) -> None:
        """Measure durability instead of curves."""
        from taxel.calibration.stored import check_output
        from taxel.cli.devices.calibrate_cycles import measure_cycles, write_cycles

        _need_scipy()
        check_output(self.output, self.overwrite)
        if len(self.source) != 1:
            raise BadInput("one source with --cycles", f"{len(self.source)}", "name one")
        document = measure_cycles(self.source[0], self.sensors, cycles, self.tap_hz)
        write_cycles(self.output, document, self.json)

    def _live(self) -> bool:
        """Return whether forces are asked for, and nothing is read or corrected."""
        first = next(iter(self.source), "")
        return self.apply is None and "://" in first and not first.startswith("replay://")

    def _is_simulated(self) -> bool:
        return next(iter(self.source), "").startswith("sim://")

    def _check_options(self) -> None:
        """Refuse options that could only fail later, before anything is read or pressed."""
        if self.rounds < 1 or not 0 <= self.seed <= 1_000_000_000:
            raise BadInput("--rounds of at least 1 and --seed within 0 and 1000000000",
                           f"{self.rounds} and {self.seed}", "choose others")  # fmt: skip
        forces = [force for force in self.forces if math.isfinite(force) and 0 < force <= 1000]
        if len(set(forces)) < 3 or len(forces) < len(self.forces):
            raise BadInput(
                "at least 3 forces above 0 and up to 1000 N for --forces",
                " ".join(f"{force:g}" for force in self.forces),
                "for example --forces 0.5 1 2 3 5",
            )
        if self.html is not None:
            if self.html.suffix not in (".html", ".htm"):
                raise BadInput("a page that ends in .html", str(self.html), "rename it")
            if self.html.exists() and not self.overwrite:
                raise BadInput("a page that does not exist yet", str(self.html),
                               "choose another, or --overwrite")  # fmt: skip
            try:
                import matplotlib  # noqa: F401
            except ModuleNotFoundError as error:
                raise MissingExtra("matplotlib", "train", "figures") from error

    def _taken(self) -> tuple[list[PressedRecording], SensorInfo, list[dict[str, Any]]]:
        """Return what to calibrate from, the array, and where it comes from."""
        first = self.source[0]
        live = self._live()
        if live and len(self.source) > 1:
            raise BadSource("one address, or recordings", f"{len(self.source)}", "name one")
        if live and self.presses:
            raise BadInput("--presses with a recording", first, "record first: taxel record")
        if first.startswith("sim://"):
            return self._simulated(first)
        if live:
            return self._recorded((self._press_live(first),), ())
        return self._recorded(
            tuple(Path(address.removeprefix("replay://")) for address in self.source), self.presses
        )

    def _recorded(
        self, paths: tuple[Path, ...], tables: tuple[Path, ...]
    ) -> tuple[list[PressedRecording], SensorInfo, list[dict[str, Any]]]:
        from taxel.calibration.apply import rate_of
        from taxel.calibration.presses import script_of_marks, script_of_table
        from taxel.calibration.results import PressedRecording

        if tables and len(tables) != len(paths):
            raise BadInput(
                "one table of presses a recording",
                f"{len(tables)} for {len(paths)}",
                "name them in the recordings' order",
            )
        taken: list[PressedRecording] = []
        made_from = []
        sensor: SensorInfo | None = None
        for number, path in enumerate(paths):
            recording = read_recording(path)
            info, samples = recording.manifest.sensor, recording.samples
            if "calibration" in info.details:
                raise BadInput("a raw recording", f"{path}, a corrected one", "take the raw one")
            if sensor is not None and _identity(info) != _identity(sensor):
                raise BadInput("recordings of one array", f"another one in {path}", "sort them")
            sensor = sensor or info
            if not len(samples):
                raise BadInput("a recording with scans", f"none in {path}", "record it again")
            script = (
                script_of_table(tables[number], info, float(samples.fitted_s[0]))
                if tables
                else script_of_marks(recording.marks, info)
            )
            rate_hz = rate_of(samples, info.rate_hz)
            taken.append(PressedRecording(samples=samples, script=script, rate_hz=rate_hz))
            made_from.append(
                {
                    "source": path.name,
                    "sha256": sha256_of(path, path.stat().st_size),
                    "presses": len(script.presses),
                    "groups": dict(recording.manifest.groups),
                }
            )
        assert sensor is not None, "at least one recording was named"
        return taken, sensor, made_from

    def _simulated(
        self, address: str
    ) -> tuple[list[PressedRecording], SensorInfo, list[dict[str, Any]]]:
        """Press each sensor of the simulated hand with the simulated gauge."""
        from taxel.calibration.presses import script_of_marks
        from taxel.calibration.results import PressedRecording
        from taxel.recordings.manifest import Manifest
        from taxel.recordings.writer import Recorder
        from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
        from taxel.sources.simulated.teng_options import parse_options

        name, _, query = address.removeprefix("sim://").partition("?")
        try:
            options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query)))
        except ValueError as error:
            raise BadSource("options as key=value&key=value", query, "mend the address") from error
        if name != "teng" or self.sensors:
            raise BadSource("sim://teng, all of its sensors", address, "mend the address")
        options.pop("speed", None)
        hand, choice = parse_options(options)
        if choice.shape or math.isfinite(choice.seconds):
            raise BadSource("no shape and no seconds under the gauge", address, "leave them out")
        gauge = ForceGauge(
            hand,
            GaugeConfig(
                forces_n=self.forces, rounds=self.rounds, material=choice.material or "plastic"
            ),
        )
        parts, marks = [], []
        for samples, own in gauge.script():
            parts.append(samples)
            marks += own
        if self.recording is not None:
            manifest = Manifest.started_now(gauge.info, groups={"session": "gauge"}, now_s=0.0)
            with Recorder(self.recording, manifest, overwrite=self.overwrite) as recorder:
                for samples in parts:
                    recorder.write(samples)
                    recorder.flush()
                for mark in marks:
                    recorder.mark(mark)
        script = script_of_marks(marks, gauge.info)
        taken = PressedRecording(samples=Samples.join(parts), script=script, rate_hz=hand.rate_hz)
        return [taken], gauge.info, [{"source": address, "presses": len(script.presses)}]

    def _press_live(self, address: str) -> Path:
        """Ask for presses on the terminal; return the raw recording."""
        from taxel.calibration.guided import asked_presses, record_presses
        from taxel.sources.opening import open_source

        path = self.recording or self.output.with_suffix(".mcap")
        if path.exists() and not self.overwrite:
            raise BadInput("a recording that does not exist yet", str(path), "choose another")
        with open_source(address) as source:
            names = source.info.channels
            try:
                chosen = source.info.indices(self.sensors or names)
            except ValueError as error:
                raise BadInput("sensors of this array", str(error), "mend --sensors") from error
            made = record_presses(
                source,
                path,
                asked_presses(chosen, self.forces, self.rounds),
                _ask,
                say_aside,
                SystemClock(),
                self.overwrite,
            )
        say_aside(f"{path}: {number_of(made, 'press')}")
        return path

    def _correct(self, calibration: Path) -> None:
        from taxel.calibration.apply import write_corrected
        from taxel.calibration.stored import read_calibration, shown_units

        if len(self.source) != 1 or self.presses or self.html:
            raise BadInput("one recording with --apply", " ".join(self.source), "name one")
        stored = read_calibration(calibration)
        ledger = write_corrected(
            Path(self.source[0].removeprefix("replay://")),
            self.output,
            stored,
            self.unit,
            self.overwrite,
        )
        if self.json:
            print_json(ledger)
            return
        lines = ledger["baselines"].values()
        drift = max((abs(line["drift_v_per_hour"]) for line in lines), default=0.0)
        level = max((abs(line["level_v"]) for line in lines), default=0.0)
        borrowed = ledger["borrowed_baselines"]
        _, small, factor = shown_units(stored.units)
        say(
            f"{self.output}: {number_of(ledger['scans'], 'scan')} in {ledger['unit']}; baselines "
            f"up to {factor * level:.1f} {small} and drifts up to {factor * drift:.1f} {small}/h "
            "taken away; "
            f"raw: {self.source[0]}"
        )
        if borrowed:
            say(f"no rest seen on {', '.join(borrowed)}: the calibration's own baseline was taken")

    def _print(self, document: dict[str, Any]) -> None:
        from taxel.calibration.report import findings, narrow_table, notes

        table = Table(title=f"{self.output}", title_justify="left", padding=(0, 1), box=None)
        names, rows = narrow_table(document)
        for number, name in enumerate(names):
            table.add_column(
                name, justify="right" if number else "left", no_wrap=name in ("sensor", "range N")
            )
        for row in rows:
            table.add_row(*row)
        console.print(table)
        for line in [*findings(document), *notes(document)]:
            say(line)
        if self.html is not None:
            say(f"page:  {self.html}")
        further = command("taxel", "calibrate", "RECORDING", "--apply", self.output,
                          "--output", "CORRECTED.mcap")  # fmt: skip
        say(f"next:  {further}")


def _identity(info: SensorInfo) -> tuple[Any, ...]:
    return info.name, info.channels, info.units, info.serial, info.details.get("seed", "")


def _ask(question: str) -> str:
    ask(question)
    line = sys.stdin.readline()
    if not line:
        raise EOFError
    return line


def _need_scipy() -> None:
    try:
        import scipy  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtra("scipy", "sim", "fitting curves") from error
