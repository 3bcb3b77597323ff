"""What `taxel evaluate` does with tactile cameras: the paper's tables, and warnings."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.progress import Progress as Bar

from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.bundles.engine import EngineName, Precision
    from taxel.evaluation.transition_data import PourSet
    from taxel.training.extractors import BackboneExtractor, SlipExtractor
    from taxel.training.features import FrameFeatures, Progress
    from taxel.training.heads import HeadConfig
    from taxel.windows.pours import Pour
    from taxel.windows.rest import Tare

PAPER_BACKBONES = ("densenet121", "efficientnet-b0", "resnet50", "resnet101")
GEL = "gel"
"""Name of the features that markers and imprint give, beside the backbones."""


@dataclass(frozen=True, kw_only=True)
class GraspOptions:
    """Grasp transitions: what to learn from and how."""

    rule: str = "change"
    """Rule of the labels: change (the paper's), micro-slip, slip, gross-slip or drop."""
    test: Path | None = None
    """grasp-warnings: a folder of cups that are only judged; without it each cup of --data is
    held out in turn."""
    backbones: tuple[str, ...] = ("efficientnet-lite0",)
    """Whose features to use: names of backbones, "paper" for the paper's four, or "gel" for what
    markers and imprint do."""
    head: str = "lstm"
    """grasp-warnings: lstm, lstm2, lstm4 or transformer."""
    frames: int = 8
    """grasp-warnings: frames in a window, k."""
    ahead: int = 0
    """Frames by which training labels run ahead, so that a head learns to warn."""
    weights: Path | None = None
    """A file or folder of backbone weights; see also the variable TAXEL_WEIGHTS."""
    cache: Path | None = None
    """Folder for features; $TAXEL_CACHE or ~/.cache/taxel unless given."""
    engine: Literal["onnxruntime", "openvino"] = "onnxruntime"
    """Which library runs backbones."""
    precision: Literal["f32", "bf16", "int8"] = "f32"
    """Numbers within the backbone; bf16 needs --engine openvino, int8 the extra openvino and
    frames of the recordings for calibration."""
    threads: int = 1
    """Threads of the engine; more help on an idle machine only."""
    paper_settings: bool = False
    """Train as the paper did: batch 4, 100 epochs, no change of step size, features as they are."""
    single_split: bool = False
    """transition-tables: only the paper's split, one cup held out."""


def run_tables(
    options: GraspOptions, data: Path | None, seed: int, as_json: bool, cups: int = 5
) -> None:
    """Print Tables 1 to 3 of the grasp-transition paper."""
    from taxel.evaluation.step_times import time_step
    from taxel.evaluation.transition_tables import measure_rows, plan_rows, trivial_rows
    from taxel.models.transition import FRAMES

    backbones = _backbones(options)
    if GEL in backbones:
        raise BadInput("backbones for the tables", GEL, "use it with: evaluate grasp-warnings")
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch, progress() as bar:
        folder = data or _simulated(Path(scratch), seed, cups, bar)
        pours = load_set(options, folder, bar)
        features: dict[str, list[FrameFeatures]] = {}
        labels, times = {}, {}
        plans = plan_rows(backbones)
        for name in backbones:
            extractor = open_features(name, options, pours)
            features[name] = extract_features(extractor, name, pours, options, bar)
            labels[name] = extractor.weights.label  # type: ignore[union-attr]
            for plan in plans:
                if plan.model.startswith(f"{name}+") and plan.frames == FRAMES:
                    times[plan.model] = time_step(
                        plan.model, extractor=extractor, engine=options.engine,  # type: ignore[arg-type]
                        precision=options.precision, threads=options.threads,
                    )  # fmt: skip
        task = bar.add_task("training", total=len(plans))
        rows = measure_rows(
            pours, features, labels, plans, head_config(options, seed),
            every_cup=not options.single_split,
            on_row=lambda name: bar.update(task, description=name, advance=1),
        )  # fmt: skip
        baselines = trivial_rows(pours)
    if as_json:
        print_json(
            {
                "rule": options.rule,
                "unstable": pours.unstable_share(),
                "rows": [asdict(row) for row in rows],
                "baselines": [asdict(one) for one in baselines],
                "steps": [asdict(step) for step in times.values()],
            }
        )
        return
    from taxel.views.grasp_results import transition_tables

    console.print(transition_tables(rows, baselines, times, options.rule, pours.unstable_share()))
    say(
        f"training of all rows: {sum(row.training_s for row in rows):.0f} s of processor time; "
        f"steps: {options.engine} {options.precision}, {options.threads} thread(s)."
    )
    if options.rule == "change":
        say(
            "The rule compares images with the first ones, so a difference of pixels solves it "
            "too: read the tables as parity with the paper, not as a warning of slip."
        )


def run_warnings(
    options: GraspOptions, data: Path | None, seed: int, as_json: bool, plot: Path | None
) -> None:
    """Print how early and how reliably a monitor warns of gross slip on unseen cups."""
    from taxel.evaluation.grasp_warnings import (
        folds_within,
        split_by_folder,
        warn_on_unseen_cups,
        warn_trivially,
    )
    from taxel.evaluation.transition_data import trivial_features

    if data is None:
        raise BadInput(
            "a folder of pours to learn from", "none",
            "make one with: taxel simulate cup-pour --output cups, then add --data cups",
        )  # fmt: skip
    with progress() as bar:
        pours = load_set(options, data, bar)
        if options.test is not None:
            pours, folds = split_by_folder(pours, load_set(options, options.test, bar))
        else:
            folds = folds_within(pours)
        results = []
        task = bar.add_task("training", total=None)
        for name in _backbones(options):
            extractor = open_features(name, options, pours)
            features = extract_features(extractor, name, pours, options, bar)
            config = head_config(options, seed)
            found, _ = warn_on_unseen_cups(
                pours, features, config, folds, name=f"{name}+{options.head}",
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )  # fmt: skip
            results.append(found)
        columns = [trivial_features(pours, index) for index in range(len(pours.pours))]
        for name in columns[0]:
            results.append(
                warn_trivially(
                    pours, lambda i, name=name: columns[i][name], folds, name=name,  # type: ignore[misc]
                    frames=options.frames,
                )
            )  # fmt: skip
    if plot is not None:
        from taxel.views.pour_figure import write_pour_figure

        write_pour_figure(plot, pours, results[0], options.frames)
    if as_json:
        print_json([_plain(result) for result in results])
        return
    from taxel.views.grasp_results import warning_tables

    console.print(warning_tables(results, options.rule))
    if plot is not None:
        say(f"probability over time with the true events: {plot}")


def run_precisions(options: GraspOptions, data: Path | None, seed: int, as_json: bool) -> None:
    """Print what each engine and number format of a backbone loses and costs."""
    from importlib.util import find_spec

    from taxel.evaluation.precisions import WAYS, compare_precisions
    from taxel.evaluation.transition_data import cup_folds

    backbones = _backbones(options)
    if GEL in backbones:
        raise BadInput("a backbone, which runs in an engine", GEL, "name one with --backbones")
    ways = [w for w in WAYS if find_spec("openvino") or w == WAYS[0]]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch, progress() as bar:
        folder = data or _simulated(Path(scratch), seed, 5, bar)
        pours = load_set(options, folder, bar)
        fold = cup_folds(pours.groups("cup"))[-1]
        rows = []
        for backbone in backbones:
            task = bar.add_task(backbone, total=None)

            def show(way: str, done: Progress, name: str = backbone, task: Any = task) -> None:
                bar.update(task, description=f"{name}, {way}", completed=done.recordings)

            def open_way(
                engine: EngineName, precision: Precision, train: Sequence[Pour],
                name: str = backbone,
            ) -> BackboneExtractor:  # fmt: skip
                chosen = replace(options, engine=engine, precision=precision)
                return _open_backbone(name, chosen, train)

            rows += compare_precisions(
                pours, fold, head_config(options, seed), open_way, ways, _cache(options),
                threads=options.threads, on_progress=show,
            )  # fmt: skip
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    from taxel.views.grasp_results import precision_table

    console.print(precision_table(rows, options.rule, options.threads))
    if len(ways) == 1:
        say("OpenVINO and 8-bit numbers are not installed: pip install 'taxel[openvino]'")


def _plain(result: Any) -> dict[str, Any]:
    return {
        "name": result.name,
        "windows": asdict(result.windows),
        "events": result.events.as_dict(),
        "by": {k: {v: s.as_dict() for v, s in g.items()} for k, g in result.by.items()},
        "thresholds": [asdict(one.config) for one in result.tuned],
    }


def _backbones(options: GraspOptions) -> tuple[str, ...]:
    names: list[str] = []
    for name in options.backbones:
        names += PAPER_BACKBONES if name == "paper" else [name]
    if not names:
        raise BadInput("at least one backbone", "none", "name one with --backbones")
    return tuple(dict.fromkeys(names))


def head_config(options: GraspOptions, seed: int) -> HeadConfig:
    """Return how a head is trained; head and k as the options say.

    Raises:
        BadInput: An option lies outside its limits.
    """
    from taxel.training.heads import PAPER, HeadConfig

    if not 0 <= seed < 2**31 or not 1 <= options.threads <= 64:
        raise BadInput("a --seed of at least 0 and 1 to 64 --threads",
                       f"{seed} and {options.threads}", "mend them")  # fmt: skip
    if not 0 <= options.ahead <= 600:
        raise BadInput("--ahead within 0 and 600", str(options.ahead), "choose another")
    if not 2 <= options.frames <= 64:
        raise BadInput("--frames within 2 and 64", str(options.frames), "choose another")
    chosen = {"seed": seed, "head": options.head, "frames": options.frames}
    if options.paper_settings:
        return replace(PAPER, **chosen)  # type: ignore[arg-type]
    tare: Tare = "size" if options.rule == "change" else "change"
    return HeadConfig(tare=tare, ahead=options.ahead, **chosen)  # type: ignore[arg-type]


def _cache(options: GraspOptions) -> Path:
    from taxel.training.features import default_cache

    return options.cache or default_cache()


def _simulated(scratch: Path, seed: int, cups: int, bar: Bar) -> Path:
    from taxel.sim.cup_pour import CupPourConfig, list_runs
    from taxel.sources.pour_sets import write_pours

    config = CupPourConfig(seed=seed, cups=cups)
    task = bar.add_task("simulating", total=len(list_runs(config)))
    write_pours(scratch / "cups", config, lambda _: bar.update(task, advance=1))
    return scratch / "cups"


def load_set(options: GraspOptions, folder: Path, bar: Bar) -> PourSet:
    """Read and label a folder of pours."""
    from taxel.evaluation.transition_data import load_pours

    task = bar.add_task("labels", total=None)
    return load_pours(folder, options.rule, _cache(options), _shown(bar, task, "labels"))


def open_features(
    name: str, options: GraspOptions, pours: PourSet
) -> BackboneExtractor | SlipExtractor:
    """Return what gives features, by name: a backbone, or "gel"."""
    from taxel.training.extractors import SlipExtractor
    from taxel.windows.rest import SETTLE

    return SlipExtractor(SETTLE) if name == GEL else _open_backbone(name, options, pours.pours)


def _open_backbone(name: str, options: GraspOptions, pours: Sequence[Pour]) -> BackboneExtractor:
    """Open a backbone for the cameras of some recordings, whose images may calibrate it."""
    from taxel.training.extractors import open_backbone
    from taxel.training.quantising import calibration_frames

    camera = pours[0].cameras[0]
    frames = calibration_frames(pours) if options.precision == "int8" else ()
    return open_backbone(
        name, options.weights, engine=options.engine, precision=options.precision,
        threads=options.threads, size_px=(camera.height, camera.width), calibration=frames,
    )  # fmt: skip


def extract_features(
    extractor: BackboneExtractor | SlipExtractor,
    name: str,
    pours: PourSet,
    options: GraspOptions,
    bar: Bar,
) -> list[FrameFeatures]:
    """Return the features of a set's frames, from the cache where it has them."""
    from taxel.training.features import extract

    task = bar.add_task(f"features of {name}", total=len(pours.pours))
    return extract(pours.pours, extractor, _cache(options), _shown(bar, task, f"features, {name}"))


def _shown(bar: Bar, task: Any, what: str) -> Callable[[Progress], None]:
    def show(done: Progress) -> None:
        speed = f", {done.frames_hz:.0f} frames/s" if done.frames else ""
        bar.update(task, description=what + speed, completed=done.recordings, total=done.of)

    return show
