"""`taxel reproduce slip-trials`: slip or hold, on objects never seen."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class SlipTrials:
    """Print how well slip is predicted from crops of trials, split by object, beside controls."""

    data: Path | None = None
    """A folder of recordings of the public data set gelsight-slip."""
    crop: int = 48
    """Frames in a crop."""
    fold_count: int = 5
    """Parts of the objects, each held out once."""
    cache: Path | None = None
    """Folder for features; $TAXEL_CACHE or ~/.cache/taxel unless given."""
    seed: int = 0
    """Seed of folds and models."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Measure and print."""
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

        if self.data is None:
            raise BadInput(
                "a folder of trials", "none",
                "import one with: taxel import gelsight-slip --data FOLDER --output slips, then "
                "add --data slips",
            )  # fmt: skip
        if not LEAST_CROP <= self.crop <= 10_000:
            raise BadInput(
                f"--crop of {LEAST_CROP} to 10000 frames", str(self.crop), "choose another"
            )
        if not 0 <= self.seed < 2**31:
            raise BadInput("a --seed of at least 0", str(self.seed), "choose another")
        with progress() as bar:
            task = bar.add_task("reading trials", total=None)
            pours = read_pours(self.data)
            check_trials(pours, self.crop)

            def show(done: Progress) -> None:
                speed = f", {done.frames_hz:.0f} frames/s" if done.frames else ""
                bar.update(task, description=f"features{speed}", completed=done.recordings,
                           total=done.of)  # fmt: skip

            features = extract(pours, CropExtractor(self.crop), self.cache or default_cache(), show)
            crops = cut_crops(
                features,
                [pour.labels["outcome"] == "slip" for pour in pours],
                [pour.groups["object"] for pour in pours],
                self.crop,
            )
            task = bar.add_task("training", total=self.fold_count * len(CONTENDERS))
            results = judge_slips(
                crops, self.fold_count, self.seed,
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )  # fmt: skip
        if self.json:
            print_json(
                {
                    "trials": len(crops.slipped),
                    "objects": len(set(crops.objects.tolist())),
                    "crops_a_trial": len(PLACES),
                    "crop": self.crop,
                    "folds": self.fold_count,
                    "rows": [asdict(row) for row in results],
                }
            )
            return
        from taxel.views.slip_results import slip_tables

        console.print(slip_tables(results, crops, self.fold_count))
