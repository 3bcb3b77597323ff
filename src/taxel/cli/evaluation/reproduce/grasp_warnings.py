"""`taxel reproduce grasp-warnings`: how early and how reliably gross slip is warned of."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.cli.figure_files import need_figures
from taxel.cli.options.cameras import (
    AHEAD,
    BACKBONE_ONLY,
    GEL,
    THREADS,
    EngineOptions,
    FitOptions,
    HeadOptions,
    LabelOptions,
    WeightOptions,
    backbone_names,
    extract_features,
    head_config,
    load_set,
    open_features,
)
from taxel.cli.options.rules import Only
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.errors import BadDataset, BadInput
from taxel.sim.pour.state import has_truth

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from rich.progress import Progress as Bar

    from taxel.evaluation.transitions.data import CameraSet


@dataclass(frozen=True, kw_only=True)
class GraspWarnings:
    """Print lead times and false alarms of monitors on unseen cups, beside trivial baselines."""

    data: Path | None = None
    """A folder of recordings of tactile cameras to learn from."""
    test: Path | None = None
    """A folder of cups that are only tested; without it each cup of --data is held out in turn."""
    features: tuple[str, ...] = ("efficientnet-lite0",)
    """Features of each frame: gel (from markers and imprint), names of backbones, or "paper" for
    the paper's four."""
    plot: Path | None = None
    """Write a figure of probability over time with the true events (PNG)."""
    json: bool = False
    """Print JSON."""
    labels: Annotated[LabelOptions, tyro.conf.arg(name="")] = field(default_factory=LabelOptions)
    head: Annotated[HeadOptions, tyro.conf.arg(name="")] = field(default_factory=HeadOptions)
    fit: Annotated[FitOptions, tyro.conf.arg(name="")] = field(default_factory=FitOptions)
    weights: Annotated[WeightOptions, tyro.conf.arg(name="")] = field(default_factory=WeightOptions)
    engine: Annotated[EngineOptions, tyro.conf.arg(name="")] = field(default_factory=EngineOptions)

    RULES: ClassVar = (
        AHEAD,
        THREADS,
        Only(BACKBONE_ONLY, "a backbone in --features", lambda o: set(o.features) != {GEL}),
    )

    def run(self) -> None:
        """Measure and print."""
        self.engine.check()
        if self.data is None:
            made = command("taxel", "simulate", "cup-pour", "--output", "cups")
            raise BadInput(
                "a folder of recordings to learn from", "none",
                f"make one with: {made}, then add --data cups",
            )  # fmt: skip
        if self.plot is not None:
            need_figures(self.plot)
        with progress() as bar:
            pours, results = self._results(self.data, bar)
        if self.plot is not None:
            from taxel.views.figures.pour import write_pour_figure

            write_pour_figure(self.plot, pours, results[0], self.head.frames)
        if self.json:
            print_json([_plain(result) for result in results])
            return
        from taxel.views.tables.grasps import warning_tables

        console.print(warning_tables(results, self.labels.rule))
        if self.plot is not None:
            say(f"probability over time with the true events: {self.plot}")

    def _results(self, data: Path, bar: Bar) -> tuple[CameraSet, list[Any]]:
        """Return the recordings, and the scores of each kind of features and each baseline."""
        from taxel.evaluation.early_warning.grasp_warnings import (
            split_by_folder,
            warn_on_unseen_cups,
            warn_trivially,
        )
        from taxel.evaluation.transitions.data import cup_folds, trivial_features

        names = backbone_names(self.features, "--features")
        pours = _with_truth(load_set(self.labels, data, bar))
        if self.test is not None:
            others = _with_truth(load_set(self.labels, self.test, bar))
            pours, folds = split_by_folder(pours, others)
        else:
            folds = cup_folds(pours.cups())
        results = []
        task = bar.add_task("training", total=None)
        for name in names:
            config = head_config(self.labels.rule, self.fit, self.head, features=name)
            extractor = open_features(name, pours, self.weights, self.engine, config.tare)
            features = extract_features(extractor, name, pours, self.labels.folder(), bar)
            found, _ = warn_on_unseen_cups(
                pours, features, config, folds, name=f"{name}+{self.head.head}",
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )  # fmt: skip
            results.append(found)
        columns = [trivial_features(pours, index) for index in range(len(pours.pours))]
        for name in columns[0]:

            def column(index: int, name: str = name) -> NDArray[np.float64]:
                return columns[index][name]

            results.append(warn_trivially(pours, column, folds, name=name, frames=self.head.frames))
        return pours, results


def _with_truth(pours: CameraSet) -> CameraSet:
    """Return pours whose true slip is known: warnings are measured against it, whatever the rule.

    Raises:
        BadDataset: Of one it is not.
    """
    for pour in pours.pours:
        if not has_truth(pour.sensor.channels):
            raise BadDataset(
                "simulated pours, whose true slip this study measures warnings against",
                f"{pour.path} without it",
                "make some with: taxel simulate cup-pour; what a monitor of your own recordings "
                "is worth says taxel train-monitor",
            )  # fmt: skip
    return pours


def _plain(result: Any) -> dict[str, Any]:
    return {
        "name": result.name,
        "windows": asdict(result.windows),
        "events": result.events.as_dict(),
        "by": {k: {v: s.as_dict() for v, s in g.items()} for k, g in result.by.items()},
        "thresholds": [asdict(tuned.config) for tuned in result.tuned],
    }
