"""`taxel bundle`: turn a run into the one file that runs live."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import console, print_json
from taxel.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """Export a run to one file (ONNX, window, scaling, labels, checksum) and check parity."""

    trained: tyro.conf.Positional[Path]
    """A run's folder, as taxel train writes it."""
    output: Path
    """The file to write, by custom NAME.taxel."""
    data: Path | None = None
    """Recordings to measure parity on; those that the run was trained on unless given."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Export and print the parity found."""
        from taxel.bundles.writer import write_bundle
        from taxel.sim.teng_constants import SENSORS
        from taxel.training.run import load_run
        from taxel.windows.dataset import load_dataset

        trained = load_run(self.trained)
        data = self.data or Path(trained.data)
        if not data.exists():
            raise BadInput(
                "recordings to measure parity on", f"no {data}", "name some with --data FOLDER"
            )
        windows = load_dataset(data, trained.contract.window).windows[:2000]
        contract = write_bundle(
            self.output, trained.networks, trained.contract, windows.values, windows.mask
        )
        assert contract.parity is not None
        if self.json:
            print_json(
                {
                    "bundle": str(self.output),
                    "bytes": self.output.stat().st_size,
                    "parity": contract.parity,
                    "windows": len(windows),
                }
            )
            return
        console.print(
            f"{self.output}: {self.output.stat().st_size:,} bytes; probabilities differ from "
            f"PyTorch's by at most {contract.parity:.1e} over {len(windows)} windows"
        )
        hand = contract.channels == SENSORS
        source = "sim://teng --seconds 20" if hand else "replay://RECORDING"
        console.print(f"next: taxel live {self.output} {source}")
