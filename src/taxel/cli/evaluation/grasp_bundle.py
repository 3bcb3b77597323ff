"""`taxel evaluate` with a bundle that watches a grasp: its alarms on recordings of cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadDataset, BadInput


def evaluate_grasp_bundle(
    bundle: Path, folder: Path | None, folds: Path | None, *, as_json: bool
) -> None:
    """Score a bundle that watches a grasp on recordings and print it.

    Args:
        bundle: The bundle's file.
        folder: Recordings of tactile cameras, whose outcome is known.
        folds: Refused: a warning has no folds.
        as_json: Print JSON instead of a table.

    Raises:
        BadInput: No folder is named, a table of folds is, or $TAXEL_DEVICE is not there.
        BadBundle: The bundle cannot be used, or was not made for such cameras.
        BadDataset: Of no grasp it is known whether it held.
    """
    from taxel.evaluation.early_warning.bundle_warnings import judged, summed
    from taxel.jobs.running import side_by_side
    from taxel.live.whole_grasps import watch_grasps
    from taxel.models.devices import asked_device
    from taxel.plain_text import finite
    from taxel.recordings.reader import list_recordings
    from taxel.views.tables.grasp_scores import grasp_score_table

    name = bundle.stem
    if folder is None:
        raise BadInput(
            f"recordings to score {name} on", "none", f"taxel evaluate {name} RECORDINGS"
        )
    if folds is not None:
        raise BadInput("a bundle of an array beside --folds", "one that watches grasps",
                       "leave it out")  # fmt: skip
    device = asked_device()
    files = list_recordings(folder)
    with progress() as bar:
        task = bar.add_task(f"watching with {name}", total=len(files))
        tracks = side_by_side(
            watch_grasps, [(bundle, file, device) for file in files],
            lambda _: bar.update(task, advance=1),
        )  # fmt: skip
    found = [judged(file, own) for file, own in zip(files, tracks, strict=True)]
    score = summed([grasp for grasps in found for grasp in grasps], folder)
    warning = trained_on_warning(bundle, files)
    if as_json:
        about = {"bundle": name, "data": str(folder), "warning": warning}
        print_json(dict(finite(asdict(score) | about)))
        return
    console.print(grasp_score_table(score, name, str(folder)))
    if warning is not None:
        say(f"warning: {warning}", style="yellow")


def trained_on_warning(bundle: Path, files: Sequence[Path]) -> str | None:
    """Return a warning where these are the very recordings that a monitor was trained on.

    Of some of them, or more, a bundle does not say it; slip warnings are trained on simulated cups.
    """
    from taxel.bundles.grasp import SLIP_COLUMNS, read_grasp_contract
    from taxel.views.tables.trained_on import trained_on_line
    from taxel.windows.camera_recordings import digest_of_all, read_camera_recording

    contract = read_grasp_contract(bundle)
    if contract.features in SLIP_COLUMNS:
        return None
    try:
        pours = [read_camera_recording(file, least=1) for file in files]
    except BadDataset:  # no monitor is trained on such a one, and its grasps count for nothing
        return None
    same = digest_of_all(pours) == contract.data_digest
    return trained_on_line([pour.name for pour in pours] if same else [], "recordings", known=True)
