"""`taxel reproduce precisions`: what engines and number formats of a backbone cost and lose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.cli.options.cameras import (
    AHEAD,
    GEL,
    EngineOptions,
    FitOptions,
    HeadOptions,
    LabelOptions,
    WeightOptions,
    backbone_names,
    given_or_simulated,
    head_config,
    load_set,
    open_backbone,
)
from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from taxel.bundles.engine import EngineName, Precision
    from taxel.training.frames.extractors import BackboneExtractor
    from taxel.training.frames.features import Progress
    from taxel.windows.camera_recordings import CameraRecording
    from taxel.windows.rest import Tare


@dataclass(frozen=True, kw_only=True)
class Precisions:
    """Print what ONNX Runtime and OpenVINO, in 32, 16 and 8 bits, cost and lose.

    A head is trained once, and its features are computed in each way.
    """

    data: Path | None = None
    """A folder of recordings of tactile cameras; simulated unless given."""
    backbones: tuple[str, ...] = ("efficientnet-lite0",)
    """Names of backbones, or "paper" for the paper's four."""
    json: bool = False
    """Print JSON."""
    labels: Annotated[LabelOptions, tyro.conf.arg(name="")] = field(default_factory=LabelOptions)
    head: Annotated[HeadOptions, tyro.conf.arg(name="")] = field(default_factory=HeadOptions)
    fit: Annotated[FitOptions, tyro.conf.arg(name="")] = field(default_factory=FitOptions)
    weights: Annotated[WeightOptions, tyro.conf.arg(name="")] = field(default_factory=WeightOptions)

    RULES: ClassVar = (AHEAD,)

    def run(self) -> None:
        """Measure and print."""
        from taxel.evaluation.transitions.precisions import WAYS

        missing = [name for name in ("openvino", "nncf") if not find_spec(name)]
        ways = [
            way for way in WAYS
            if way == WAYS[0] or ("openvino" not in missing
                                  and (way[1] != "int8" or "nncf" not in missing))
        ]  # fmt: skip
        with progress() as bar:
            rows = self._rows(ways, bar)
        if self.json:
            print_json([asdict(row) for row in rows])
            return
        from taxel.views.tables.grasps import precision_table

        console.print(precision_table(rows, self.labels.rule, self.weights.threads))
        if missing:
            what = "OpenVINO and 8-bit numbers" if "openvino" in missing else "8-bit numbers (nncf)"
            say(f"{what} are not installed, and left out: pip install 'taxel[openvino]'")

    def _rows(self, ways: list[Any], bar: Bar) -> list[Any]:
        from taxel.evaluation.transitions.data import cup_folds
        from taxel.evaluation.transitions.precisions import Ways, compare_precisions

        backbones = backbone_names(self.backbones)
        if GEL in backbones:
            raise BadInput("a backbone, which runs in an engine", GEL, "name one with --backbones")
        rows = []
        with given_or_simulated(self.data, self.fit.seed, bar) as folder:
            pours = load_set(self.labels, folder, bar)
            fold = cup_folds(pours.cups())[-1]
            for backbone in backbones:
                config = head_config(self.labels.rule, self.fit, self.head, features=backbone)
                task = bar.add_task(backbone, total=None)

                def show(way: str, done: Progress, name: str = backbone, task: Any = task) -> None:
                    bar.update(task, description=f"{name}, {way}", completed=done.recordings)

                def open_way(
                    engine: EngineName, precision: Precision, train: Sequence[CameraRecording],
                    name: str = backbone, tare: Tare = config.tare,
                ) -> BackboneExtractor:  # fmt: skip
                    chosen = EngineOptions(engine=engine, precision=precision)
                    return open_backbone(name, train, self.weights, chosen, tare)

                rows += compare_precisions(
                    pours, fold, config, open_way, Ways(ways, self.weights.threads),
                    self.labels.folder(), on_progress=show,
                )  # fmt: skip
        return rows
