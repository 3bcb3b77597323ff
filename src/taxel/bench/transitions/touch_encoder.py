"""Rows on the touch encoder: what it costs, and its linear probe on objects never seen.

Knows nothing about how rows are printed.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING

import numpy as np

from taxel.bench.rows import Row, accuracy_row, missing, quietest, row, stored
from taxel.bench.transitions.slip_trials import NAME as TRIALS

if TYPE_CHECKING:
    from taxel.evaluation.camera_trials.encoder_study import ProbeSet
    from taxel.evaluation.camera_trials.probe import ProbeResult, Rows
    from taxel.training.frames.features import Extractor

TOUCH, LITE0, RESNET = "touch", "efficientnet-lite0", "resnet50"
ROUNDS, REPEATS = 12, 6
"""The quietest round counts; in each the median of so many images. Source: our choice."""
MOST_NUMBERS, MOST_MS, MOST_MB = 1.5e6, 2.5, 6.0
MOST_OF = {LITE0: 1 / 4, RESNET: 1 / 20}
"""Goals. Source: issue 17."""
FEW, DRAWS = 5, 5
"""Labelled objects, and how often they are drawn a fold. Source: issue 17; our choice."""
LEVEL = 0.05
"""Of the paired test."""
NAME = "gelsight-slip by object, linear probe"


def cost_rows() -> list[Row]:
    """Count its numbers and bytes, and time an image beside Lite0 and ResNet50."""
    from taxel.models.backbones.catalogue import find_backbone
    from taxel.models.counting import keras_parameters
    from taxel.models.weights import shipped_weights
    from taxel.windows.touch_view import MODEL

    numbers = keras_parameters(find_backbone(TOUCH).build("logits"))
    weights = shipped_weights(TOUCH)
    name = "touch encoder: weights that come with taxel"
    size = missing(name, "MB", f"<= {MOST_MB:g}", "none")
    if weights is not None and weights.path is not None:
        megabytes = (weights.path.stat().st_size + MODEL.stat().st_size) / 1e6
        size = row(name, megabytes, "MB", "<=", MOST_MB, "16 bits; and ONNX, 32 bits")
    rounds, spent = _image_times((TOUCH, LITE0, RESNET))
    how = "ONNX Runtime f32, one thread, 320×240 in, resize included"
    rows = [
        row("touch encoder: numbers", numbers, "", "<=", MOST_NUMBERS),
        size,
        quietest("touch encoder: an image", rounds[TOUCH], "ms", MOST_MS, how),
    ]
    for other, most in MOST_OF.items():
        ratio = float(np.median(spent[TOUCH]) / np.median(spent[other]))
        note = (
            f"time of the processor, which others lengthen little: {np.median(spent[TOUCH]):.2f} "
            f"and {np.median(spent[other]):.1f} ms, medians of {ROUNDS} rounds in turn; {how}"
        )
        rows.append(row(f"touch encoder: time of an image, of {other}'s", ratio,
                        "ratio", "<=", most, note))  # fmt: skip
    return rows


def _image_times(
    names: Sequence[str],
) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Return each backbone's milliseconds an image, a round each, in turn: by the clock, and spent
    on the processor.
    """
    from taxel.training.frames.extractors import open_backbone

    engines = {name: open_backbone(name).engine for name in names}
    image = np.random.default_rng(0).integers(0, 256, (1, 240, 320, 3), np.uint8)
    times: dict[str, list[float]] = {name: [] for name in names}
    spent: dict[str, list[float]] = {name: [] for name in names}
    for _ in range(ROUNDS):
        for name, engine in engines.items():
            each = []
            for _ in range(REPEATS):
                started = perf_counter(), process_time()
                engine.run(frames=image)
                each.append((perf_counter() - started[0], process_time() - started[1]))
            wall_s, own_s = np.median(each[1:], axis=0)
            times[name].append(1e3 * float(wall_s))
            spent[name].append(1e3 * float(own_s))
    return times, spent


def probe_rows(data: Path | None) -> list[Row]:
    """Probe the encoder that comes with taxel beside the others; it never saw a real image."""
    goal = f"> 0, p < {LEVEL:g}"
    if data is None or not (data / "gelsight-slip").exists():
        why = "no recordings: name their folder with --data"
        return [missing(f"{NAME}: touch encoder less {other}", "accuracy", goal, why)
                for other in MOST_OF]  # fmt: skip
    from taxel.evaluation.camera_trials.encoder_study import (
        few_objects,
        probe_all,
        slip_probe_set,
    )
    from taxel.evaluation.camera_trials.probe import commonest
    from taxel.training.encoder.videos import read_touch_videos
    from taxel.windows.camera_trials import read_camera_trials

    folder = data / "gelsight-slip"
    probed = slip_probe_set(read_camera_trials(folder), read_touch_videos(folder))
    rows = {TOUCH: _rows_of_ours(probed), **_rows_of_others(folder, probed)}
    found = probe_all(probed, rows)
    found["commonest class"] = commonest(probed.labelled, probed.split)
    return [
        *_table(probed, found),
        *(_less(probed, found, other, goal) for other in MOST_OF),
        _few_row(few_objects(probed, rows[TOUCH], FEW, DRAWS)),
    ]  # fmt: skip


def _few_row(few: tuple[float, float]) -> Row:
    """Return the row of five labelled objects beside a forest that has all of them."""
    name, forest = f"{NAME}, {FEW} labelled objects: touch encoder", _forest()
    note = f"± {few[1]:.3f} over {DRAWS} draws; goal: a forest on grey differences, all objects"
    if forest is None:
        return accuracy_row(name, few[0], note)
    return row(name, few[0], "accuracy", ">=", forest, note)


def _rows_of_ours(probed: ProbeSet) -> list[Rows]:
    """Return the rows of the encoder that comes with taxel, pretrained in simulation alone."""
    from taxel.training.encoder.stored import shipped_encoder

    return [probed.rows_of(shipped_encoder())] * len(probed.split.folds)


def _rows_of_others(folder: Path, probed: ProbeSet) -> dict[str, list[Rows]]:
    """Return what stands beside: name → rows of each fold."""
    from taxel.evaluation.camera_trials.probe import pooled
    from taxel.evaluation.camera_trials.probe_features import (
        GreyThumbs,
        crop_features,
        gel_features,
    )
    from taxel.models.backbones.random_start import fill_randomly
    from taxel.models.backbones.touch import TouchEncoder
    from taxel.training.frames.extractors import open_backbone
    from taxel.training.frames.features import default_cache
    from taxel.windows.camera_trials import read_camera_trials

    extractors: dict[str, Extractor] = {
        LITE0: open_backbone(LITE0),
        RESNET: open_backbone(RESNET),
        "gel features": gel_features(),
        "difference of pixels": GreyThumbs(),
    }
    trials = read_camera_trials(folder)
    features = crop_features(trials, list(extractors.values()), default_cache())
    rows = {name: pooled(own) for name, own in zip(extractors, features, strict=True)}
    drawn = TouchEncoder().eval()
    fill_randomly(drawn, TOUCH, 0)
    rows["touch, random start"] = probed.rows_of(drawn)
    return {name: [own] * len(probed.split.folds) for name, own in rows.items()}


def _table(probed: ProbeSet, found: Mapping[str, ProbeResult]) -> list[Row]:
    """Return a row a network, its interval over objects in the note."""
    from taxel.evaluation.camera_trials.crossval import score_trials

    rows = []
    for name, own in found.items():
        scores = score_trials(probed.y, own.probabilities, probed.objects)
        inner = f"; inner log-loss {np.mean(own.inner):.3f}" if own.inner else ""
        low, high = scores.accuracy_interval
        label = "touch, simulation only" if name == TOUCH else name
        rows.append(
            Row(name=f"{NAME}: {label}", value=scores.accuracy, unit="accuracy",
                note=f"95 % CI over objects [{low:.3f}, {high:.3f}]; AUC {scores.auc:.3f}; "
                f"log-loss {scores.loss:.3f}{inner}")
        )  # fmt: skip
    return rows


def _less(probed: ProbeSet, found: Mapping[str, ProbeResult], other: str, goal: str) -> Row:
    from taxel.evaluation.camera_trials.probe import less_than

    less = less_than(found[TOUCH], found[other], probed.y, probed.objects)
    note = (
        f"paired over objects: p {less.p_accuracy:.3g}; log-loss {less.loss:+.3f}, "
        f"p {less.p_loss:.3g}"
    )
    return Row(name=f"{NAME}: touch encoder less {other}", value=less.accuracy, unit="accuracy",
               goal=goal, ok=less.accuracy > 0 and less.p_accuracy < LEVEL, note=note)  # fmt: skip


def _forest() -> float | None:
    """Return the accuracy of a forest on grey differences with all labelled objects, as stored."""
    note = next((r.note for r in stored("transitions") if r.name == f"{TRIALS}: accuracy"), "")
    found = re.search(r"bar: random forest on grey differences (0\.\d+)", note)
    return float(found[1]) if found else None
