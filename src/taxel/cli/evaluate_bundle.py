"""`taxel evaluate BUNDLE FOLDER`: what a bundle is worth on recordings, as it would decide live."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput


def is_bundle_file(path: Path) -> bool:
    """Return whether a path is a file that a bundle could be, and no recording."""
    return path.is_file() and path.suffix != ".mcap"


def evaluate_bundle(bundle: Path, folder: Path | None, *, as_json: bool) -> None:
    """Score a bundle on recordings and print it.

    Args:
        bundle: The bundle's file.
        folder: Recordings with its label.
        as_json: Print JSON instead of tables.

    Raises:
        BadInput: No folder is named, or $TAXEL_DEVICE is not there.
        BadBundle: The bundle cannot be used, or is of another array.
        BadDataset: The recordings hold no window with the bundle's label.
    """
    from taxel.bundles.reader import read_bundle
    from taxel.evaluation.bundle_scores import score_bundle
    from taxel.models.devices import asked_device

    if folder is None:
        raise BadInput(
            f"recordings to score {bundle} on", "none", f"taxel evaluate {bundle} RECORDINGS"
        )
    device = asked_device()
    with progress() as bar:
        bar.add_task(f"scoring {bundle.name}", total=None)
        found = score_bundle(read_bundle(bundle, device=device), folder)
    from taxel.views.part_results import bundle_score_table, seen_line

    seen = seen_line(found)
    if as_json:
        print_json({"bundle": str(bundle), "data": str(folder)} | asdict(found) | {"warning": seen})
        return
    console.print(bundle_score_table(found, bundle.name, str(folder)))
    if seen is not None:
        say(f"warning: {seen}", style="yellow")
