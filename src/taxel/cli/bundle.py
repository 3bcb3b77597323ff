"""`taxel bundle`: turn a run into the one file that runs live."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from taxel.cli.printing import command, console, print_json
from taxel.errors import BadInput

BOARD_BUNDLE = "network.taxel"
"""The bundle that stands beside its C."""


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """Export a run to one file (ONNX, window, scaling, labels, checksum) and check parity."""

    trained: tyro.conf.Positional[Path]
    """A run's folder, as taxel train writes it."""
    output: Path
    """The file to write, by custom NAME.taxel; for avr a folder, such as a copy of
    firmware/teng_classify. An older bundle there is replaced."""
    target: Literal["live", "avr"] = "live"
    """live: a file for taxel live. avr: the same, and C for an Arduino Mega 2560 beside it, which
    tells on the board itself (networks of the model cnn2d)."""
    data: Path | None = None
    """Recordings to measure parity on, and for avr the scales of 8 bits; those that the run was
    trained on unless given."""
    test: Path | None = None
    """avr: labelled recordings that the network has not seen, to measure on what 8 bits lose;
    those of --data unless given."""
    reference_mv: int | None = None
    """avr: the voltage that the board's converter compares with, millivolts, such as 5000, or 3300
    with 3.3 V on the pin AREF; as the recordings say unless given."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Export and print the parity found."""
        from taxel.bundles.recordings import load_at_level
        from taxel.bundles.writer import write_bundle
        from taxel.sim.teng_constants import SENSORS
        from taxel.training.run import load_run

        if self.target == "live" and (self.test or self.reference_mv):
            raise BadInput("--test and --reference-mv with --target avr", "them without", "say it")
        path = self.output if self.target == "live" else self.output / BOARD_BUNDLE
        older = _older(path)
        trained = load_run(self.trained)
        data = self.data or Path(trained.data)
        if not data.exists():
            raise BadInput(
                "recordings to measure parity on", f"no {data}", "name some with --data FOLDER"
            )
        windows = load_at_level(data, trained.contract).windows[:2000]
        contract = write_bundle(
            path, trained.networks, trained.contract, windows.values, windows.mask
        )
        if self.target == "avr":
            self._write_avr(path, data)
            return
        assert contract.parity is not None
        if self.json:
            print_json(
                {
                    "bundle": str(self.output),
                    "replaced": older,
                    "bytes": self.output.stat().st_size,
                    "parity": contract.parity,
                    "windows": len(windows),
                }
            )
            return
        console.print(
            f"{self.output}{', replaced' if older else ''}: {self.output.stat().st_size:,} bytes; "
            f"probabilities differ from PyTorch's by at most {contract.parity:.1e} over "
            f"{len(windows)} windows", soft_wrap=True, markup=False,
        )  # fmt: skip
        hand = contract.channels == SENSORS
        source = ("sim://teng", "--seconds", "20") if hand else ("replay://RECORDING",)
        if contract.reference is not None:
            adapt = command("taxel", "adapt", self.output, "--touches", "RECORDING")
            console.print(f"in a new session first: {adapt} ({contract.reference.touches})",
                          soft_wrap=True, markup=False)  # fmt: skip
        live = command("taxel", "live", self.output, *source)
        console.print(f"next: {live}", soft_wrap=True, markup=False)

    def _write_avr(self, bundle: Path, data: Path) -> None:
        """Write the bundle's network as C and print what it costs."""
        from dataclasses import asdict

        from taxel.bundles.avr.write import write_avr

        report = write_avr(
            bundle, self.output, data, test=self.test, reference_mv=self.reference_mv
        )
        if self.json:
            print_json(asdict(report) | {"points_lost": report.points_lost})
            return
        for line in report.lines():
            console.print(line)


def _older(path: Path) -> bool:
    """Return whether an older bundle stands there, to be replaced; refuse anything else."""
    from taxel.bundles.envelope import FIRST_WORDS

    if not path.exists():
        return False
    if path.is_file():
        with path.open("rb") as file:
            if file.read(len(FIRST_WORDS)) == FIRST_WORDS:
                return True
    raise BadInput(
        "a free name, or an older bundle, for --output", f"{path}, which holds something else",
        "name another, such as NAME.taxel",
    )  # fmt: skip
