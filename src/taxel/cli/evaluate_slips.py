"""What `taxel evaluate slip-trials` does: slip or hold, on objects never seen."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput


def run_slip_trials(
    data: Path | None, seed: int, as_json: bool, cache: Path | None, crop: int, folds: int
) -> None:
    """Print how well slip is told from crops of trials, split by object, beside controls.

    Args:
        data: Folder of recordings, as taxel import gelsight-slip writes them.
        seed: Seed of folds and models.
        as_json: Print JSON.
        cache: Folder for features; the default one unless given.
        crop: Frames in a crop.
        folds: Parts of the objects, each held out once.

    Raises:
        BadInput: The options or recordings do not allow it.
    """
    from taxel.evaluation.slip_crops import (
        LEAST_CROP,
        PLACES,
        CropExtractor,
        check_trials,
        cut_crops,
    )
    from taxel.evaluation.slip_trials import CONTENDERS, judge_slips
    from taxel.training.features import Progress, default_cache, extract
    from taxel.windows.pours import read_pours

    if data is None:
        raise BadInput(
            "a folder of trials", "none",
            "import one with: taxel import gelsight-slip --data FOLDER --output slips, then add "
            "--data slips",
        )  # fmt: skip
    if not LEAST_CROP <= crop <= 10_000:
        raise BadInput(f"--crop of {LEAST_CROP} to 10000 frames", str(crop), "choose another")
    if not 0 <= seed < 2**31:
        raise BadInput("a --seed of at least 0", str(seed), "choose another")
    with progress() as bar:
        task = bar.add_task("reading trials", total=None)
        pours = read_pours(data)
        check_trials(pours, crop)

        def show(done: Progress) -> None:
            speed = f", {done.frames_hz:.0f} frames/s" if done.frames else ""
            bar.update(task, description=f"features{speed}", completed=done.recordings,
                       total=done.of)  # fmt: skip

        features = extract(pours, CropExtractor(crop), cache or default_cache(), show)
        crops = cut_crops(
            features,
            [pour.labels["outcome"] == "slip" for pour in pours],
            [pour.groups["object"] for pour in pours],
            crop,
        )
        task = bar.add_task("training", total=folds * len(CONTENDERS))
        results = judge_slips(
            crops, folds, seed,
            on_step=lambda line: bar.update(task, description=line, advance=1),
        )  # fmt: skip
    if as_json:
        print_json(
            {
                "trials": len(crops.slipped),
                "objects": len(set(crops.objects.tolist())),
                "crops_a_trial": len(PLACES),
                "crop": crop,
                "folds": folds,
                "rows": [asdict(one) for one in results],
            }
        )
        return
    from taxel.views.slip_results import slip_tables

    console.print(slip_tables(results, crops, folds))
