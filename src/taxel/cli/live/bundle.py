"""`taxel bundle`: turn a run into the one file that runs live."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import tyro

from taxel.cli.options.rules import Only
from taxel.cli.printing import command, print_json, say
from taxel.errors import BadInput
from taxel.plain_text import number_of

if TYPE_CHECKING:
    from taxel.bundles.contract import Contract
    from taxel.bundles.signing import Signer

BOARD_BUNDLE = "network.taxel"
"""The bundle that stands beside its C."""


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """Export a run to one file (ONNX, window, scaling, labels, checksum) and check parity."""

    trained: tyro.conf.Positional[Path | None] = None
    """A run's folder; with --sign also a bundle, which is signed as it is."""
    output: Path | None = None
    """The file to write, usually NAME.taxel; with --board a folder, such as a copy of
    firmware/teng_classify. An older bundle there is replaced."""
    sign: Path | None = None
    """Sign it with this private key, an Ed25519 key in OpenSSH format, so that whoever trusts its
    public key can refuse all others."""
    new_key: Path | None = None
    """Alone: write a new private key to this file, and its public key to the same name with .pub.
    No file is replaced."""
    follow: float | None = None
    """Live, let each channel's contact gate follow its rest and noise over this many
    seconds, and report each change; as the run was trained unless given."""
    hold_level: bool = False
    """Keep the usual level, where training found that sessions' levels be followed: for
    sessions in which one thing is touched again and again."""
    board: Literal["mega"] | None = None
    """Also write C that predicts on the board itself: mega, the Arduino Mega 2560 (networks of the
    model cnn2d)."""
    data: Path | None = None
    """Recordings to measure parity on and, with --board, to fit the 8-bit quantisation; those that
    the run was trained on unless given."""
    test: Path | None = None
    """With --board: labelled recordings that the network has not seen, to measure the accuracy that
    8-bit quantisation costs; those of --data unless given."""
    reference_mv: int | None = None
    """With --board: the voltage that its converter compares with, millivolts, such as 5000, or
    3300 with 3.3 V on the pin AREF; as the recordings say unless given."""
    json: bool = False
    """Print JSON."""

    RULES: ClassVar = (
        Only(
            ("data", "follow", "hold-level", "board", "test", "reference-mv"),
            "a run to export",
            lambda o: o._exports(),
        ),
        Only(("test", "reference-mv"), "--board", lambda o: o.board is not None),
    )

    def run(self) -> None:
        """Make a key; or sign a bundle; or export a run and print the parity found."""
        if self.new_key is not None:
            self._make_key(self.new_key)
            return
        if self.trained is None or self.output is None:
            got = f"{self.trained} alone" if self.trained is not None else "no run's folder"
            raise BadInput("a run's folder and --output FILE", got, "name both")
        if self.sign is not None and self.board is not None:
            raise BadInput(
                "--sign or --board", "both, but a board checks no signature", "leave one out"
            )
        signer = None if self.sign is None else _signer(self.sign)
        if signer is not None and self.trained.is_file():
            self._sign_bundle(self.trained, self.output, signer)
            return
        self._export(self.trained, self.output, signer)

    def _exports(self) -> bool:
        """Return whether a run is exported, and not a key made or a bundle signed as it is."""
        return self.new_key is None and not (self.trained is not None and self.trained.is_file())

    def _export(self, folder: Path, output: Path, signer: Signer | None) -> None:
        """Write a run as a bundle, or with --board as C too; print what it is and costs."""
        from taxel.bundles.contract import following, holding
        from taxel.bundles.recordings import load_at_level
        from taxel.bundles.signing import fingerprint
        from taxel.bundles.trials import IN_RUN
        from taxel.bundles.writer import write_bundle
        from taxel.training.run import load_run

        if self.board is None and (folder / IN_RUN).is_file():
            for option, given in (
                ("--follow", self.follow is not None), ("--hold-level", self.hold_level),
                ("--data", self.data is not None),
            ):  # fmt: skip
                if given:
                    raise BadInput(f"a run of an array beside {option}", "one of camera trials",
                                   "leave it out")  # fmt: skip
            self._copy_trials(folder / IN_RUN, output, signer)
            return
        path = output if self.board is None else output / BOARD_BUNDLE
        older = _older(path)
        trained = load_run(folder)
        data = self.data or Path(trained.data)
        if not data.exists():
            raise BadInput(
                "recordings to measure parity on", f"no {data}", "name some with --data FOLDER"
            )
        bundle_contract = trained.contract
        if self.follow is not None:
            bundle_contract = following(bundle_contract, self.follow)
        if self.hold_level:
            bundle_contract = holding(bundle_contract)
        windows = load_at_level(data, bundle_contract).windows[:2000]

        def write(path: Path) -> Contract:
            return write_bundle(
                path, trained.networks, bundle_contract, windows.values, windows.mask, signer
            )

        if self.board is not None:
            self._write_avr(write, output, data)
            return
        contract = write(path)
        assert contract.parity is not None
        if self.json:
            print_json(
                {
                    "bundle": str(output),
                    "replaced": older,
                    "bytes": output.stat().st_size,
                    "parity": contract.parity,
                    "windows": len(windows),
                    "signed_by": signer and fingerprint(signer.public),
                }
            )
            return
        _print_exported(output, contract, len(windows), older=older, signer=signer)

    def _copy_trials(self, bundle: Path, output: Path, signer: Signer | None) -> None:
        """Write the bundle of a run of camera trials; its parity is that of the training."""
        from taxel.bundles.trials import read_trial_bundle
        from taxel.recordings.whole import write_whole

        if signer is not None:
            self._sign_bundle(bundle, output, signer)
            return
        older = _older(output)
        contract = read_trial_bundle(bundle).contract
        write_whole(output, bundle.read_bytes())
        size = output.stat().st_size
        if self.json:
            print_json({"bundle": str(output), "replaced": older, "bytes": size})
            return
        say(f"{output}{', replaced' if older else ''}: {size:,} bytes; predicts {contract.target}")
        say(f"next: {command('taxel', 'live', output, 'replay://RECORDING')}")

    def _write_avr(self, write: Callable[[Path], Contract], output: Path, data: Path) -> None:
        """Write the network as C and its bundle beside it; print what it costs.

        The bundle takes its place last: where the C is refused, an older one stays.
        """
        from dataclasses import asdict

        from taxel.bundles.avr.write import write_avr
        from taxel.held import scratch_folder
        from taxel.recordings.whole import write_whole

        with scratch_folder(output) as scratch:
            made = scratch / BOARD_BUNDLE
            write(made)
            report = write_avr(made, output, data, test=self.test, reference_mv=self.reference_mv)
            write_whole(output / BOARD_BUNDLE, made.read_bytes())
        if self.json:
            print_json(asdict(report) | {"points_lost": report.points_lost})
            return
        for line in report.lines():
            say(line)

    def _sign_bundle(self, bundle: Path, output: Path, signer: Signer) -> None:
        """Write a copy of a bundle with a signature; the same file is written anew."""
        from taxel.bundles.envelope import signed_file
        from taxel.bundles.signing import fingerprint
        from taxel.recordings.whole import write_whole

        older = _older(output)
        whole = signed_file(bundle, signer)
        _check_opens(bundle)
        write_whole(output, whole)
        if self.json:
            print_json(
                {
                    "bundle": str(output),
                    "replaced": older,
                    "bytes": output.stat().st_size,
                    "signed_by": fingerprint(signer.public),
                }
            )
            return
        say(f"{output}{', replaced' if older else ''}: {_signed_by(signer)}")

    def _make_key(self, path: Path) -> None:
        from taxel.bundles.signing import fingerprint, new_key, read_trust

        if self.trained is not None or self.output is not None or self.sign is not None:
            raise BadInput("--new-key alone", "more beside it", "make the key first, then sign")
        public = new_key(path)
        (key,) = read_trust(public).keys
        if self.json:
            files = {"private": str(path), "public": str(public)}
            print_json(files | {"fingerprint": fingerprint(key)})
            return
        say(f"{path}: a private key; keep it secret: whoever has it can sign bundles in your name")
        say(f"{public}: its public key, for taxel live --trust; {fingerprint(key)}")


def _print_exported(
    output: Path, contract: Contract, windows: int, *, older: bool, signer: Signer | None
) -> None:
    """Print a bundle's size and parity, who signed it, and the commands that may follow."""
    from taxel.sim.teng.constants import SENSORS

    say(f"{output}{', replaced' if older else ''}: {output.stat().st_size:,} bytes; "
        f"probabilities differ from the trained model's by at most {contract.parity:.1e} over "
        f"{number_of(windows, 'window')}")  # fmt: skip
    if signer is not None:
        say(_signed_by(signer))
    hand = contract.channels == SENSORS
    source = ("sim://teng", "--seconds", "20") if hand else ("replay://RECORDING",)
    if contract.reference is not None:
        adapt = command("taxel", "adapt", output, "--touches", "RECORDING")
        say(f"in a new session first: {adapt} ({contract.reference.touches})")
    say(f"next: {command('taxel', 'live', output, *source)}")


def _signer(path: Path) -> Signer:
    """Open a private key; a passphrase is asked for where there is a person."""
    from getpass import getpass

    from taxel.bundles.signing import read_key

    return read_key(path, getpass if sys.stdin.isatty() else None)


def _check_opens(bundle: Path) -> None:
    """Refuse a bundle that `taxel live` could not open: whole, but its models do not run.

    Raises:
        BadBundle: It cannot be opened, or gives other answers than when it was written.
    """
    from taxel.bundles.envelope import kind_of

    kind = kind_of(bundle)
    if kind == "grasp":
        from taxel.bundles.grasp import read_grasp_bundle

        read_grasp_bundle(bundle)
    elif kind == "trials":
        from taxel.bundles.trials import read_trial_bundle

        read_trial_bundle(bundle)
    else:
        from taxel.bundles.reader import read_bundle

        read_bundle(bundle)


def _signed_by(signer: Signer) -> str:
    from taxel.bundles.signing import fingerprint

    return f"signed by {fingerprint(signer.public)}"


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
