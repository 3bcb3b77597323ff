"""What `taxel train --grasp` does: learn a monitor from pours and write it as a bundle."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from taxel.cli.evaluate_grasps import GEL, GraspOptions, extract_features, load_set, open_features
from taxel.cli.printing import command, print_json, progress, say
from taxel.errors import BadInput

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from taxel.bundles.grasp import GraspContract
    from taxel.evaluation.learn_monitor import LearntMonitor
    from taxel.evaluation.transition_data import PourSet
    from taxel.training.features import FrameFeatures

_CHECK_WINDOWS = 32


def train_grasps(
    options: GraspOptions, features_name: str, data: Path, output: Path, seed: int, as_json: bool
) -> None:
    """Learn and write a grasp bundle."""
    from taxel.bundles.grasp import write_grasp_bundle
    from taxel.cli.evaluate_grasps import head_config
    from taxel.evaluation.learn_monitor import learn_monitor
    from taxel.models.export_onnx import export_head
    from taxel.training.extractors import BackboneExtractor

    if output.is_dir() or not output.name.endswith(".taxel"):
        raise BadInput(
            "--output NAME.taxel: a monitor is written as the bundle that runs live",
            str(output), "name a file such as grasp.taxel",
        )  # fmt: skip
    with progress() as bar:
        pours = load_set(options, data, bar)
        extractor = open_features(features_name, options, pours)
        features = extract_features(extractor, features_name, pours, options, bar)
        task = bar.add_task("training", total=None)
        config = head_config(options, seed)
        learnt = learn_monitor(
            pours, features, config,
            on_step=lambda line: bar.update(task, description=f"training, {line}", advance=1),
        )  # fmt: skip
    backbone = extractor if isinstance(extractor, BackboneExtractor) else None
    contract = _contract(options, features_name, pours, learnt, backbone)
    windows, expected = _check(features, learnt)
    head = export_head(learnt.head.module, config.frames, windows.shape[3])
    parity = write_grasp_bundle(
        output, contract, head, backbone.model if backbone else None, windows, expected
    )
    measured = dict(contract.measured)
    if as_json:
        print_json({"bundle": str(output), "parity": parity, "measured": measured,
                    "parameters": contract.parameters})  # fmt: skip
        return
    say(
        f"{output}: {features_name} + {config.head}, {contract.parameters:,} parameters, warns of "
        f"{options.rule}; probabilities differ from PyTorch's by at most {parity:.1e}"
    )
    if measured:
        say("on cups held out: " + ", ".join(f"{k} {v:.3g}" for k, v in measured.items()))
    watch = command("taxel", "live", output, "sim://cup-pour", "--seconds", "20")
    say(f"next: {watch}")


def fine_tune_backbone(
    options: GraspOptions,
    backbone: str,
    data: Path,
    output: Path,
    seed: int,
    epochs: int,
    as_json: bool,
) -> None:
    """Train a backbone end to end on pours and write its weights."""
    from taxel.cli.evaluate_grasps import head_config
    from taxel.evaluation.transition_data import tracks_of
    from taxel.models.backbones.catalogue import find_backbone
    from taxel.models.backbones.weight_files import save_backbone_weights
    from taxel.training.extractors import BackboneExtractor
    from taxel.training.fine_tuning import EndToEnd, FineTuneConfig, fine_tune
    from taxel.training.heads import fit_head

    if backbone == GEL:
        raise BadInput("a backbone to train end to end", GEL, "name one, such as edge")
    if not 1 <= epochs <= 1000:
        raise BadInput("--fine-tune within 1 and 1000 epochs", str(epochs), "choose another")
    if output.is_dir() or not output.name.endswith(".safetensors"):
        raise BadInput("--output NAME.safetensors: a backbone's weights", str(output),
                       f"name a file such as {backbone}.safetensors")  # fmt: skip
    with progress() as bar:
        pours = load_set(options, data, bar)
        extractor = open_features(backbone, options, pours)
        assert isinstance(extractor, BackboneExtractor)
        features = extract_features(extractor, backbone, pours, options, bar)
        config = head_config(options, seed)
        everything = np.arange(len(pours.pours), dtype=np.intp)
        head = fit_head(tracks_of(features, pours.labels, everything), config)
        module = find_backbone(backbone).build("logits")
        extractor.weights.load_into(module)
        task = bar.add_task("end to end", total=None)
        done = fine_tune(
            EndToEnd(module, backbone, head), pours.pours, pours.labels,
            FineTuneConfig(epochs=epochs, seed=seed), frames=config.frames, stride=config.stride,
            on_step=lambda step, of, loss: bar.update(
                task, description=f"end to end, loss {loss:.3f}", completed=step, total=of
            ),
        )  # fmt: skip
    if not done.first:
        return
    save_backbone_weights(module, output)
    if as_json:
        print_json({"weights": str(output), "losses": done.losses, "device": done.device,
                    "processes": done.processes})  # fmt: skip
        return
    say(
        f"{output}: {backbone} after {epochs} epochs on {done.device}, {done.processes} "
        f"process(es); loss {', '.join(f'{loss:.3f}' for loss in done.losses)}"
    )
    further = command("taxel", "train", data, "--grasp", backbone, "--weights", output,
                      "--output", "grasp.taxel")  # fmt: skip
    say(f"next: {further}")


def _contract(
    options: GraspOptions,
    features_name: str,
    pours: PourSet,
    learnt: LearntMonitor,
    backbone: object,
) -> GraspContract:
    from taxel import __version__
    from taxel.bundles.grasp import GraspContract
    from taxel.models.counting import keras_parameters
    from taxel.models.transition import find_transition
    from taxel.training.extractors import BackboneExtractor
    from taxel.training.frame_labels import rate_of
    from taxel.windows.rest import SETTLE

    camera = pours.pours[0].cameras[0]
    config = learnt.head.config
    measured: dict[str, float] = {}
    if learnt.windows is not None:
        measured |= {"balanced accuracy": learnt.windows.balanced, "AUC": learnt.windows.auc}
    if learnt.tuned is not None:
        measured |= {
            "median lead (s)": learnt.tuned.lead_median_s,
            "missed": learnt.tuned.missed_share,
            "false alarms a minute": learnt.tuned.false_alarms_per_min,
        }
    if features_name == GEL:
        parameters = keras_parameters(learnt.head.module)
    else:
        parameters = find_transition(f"{features_name}+{config.head}").parameters
    digest = hashlib.sha256("".join(pour.digest for pour in pours.pours).encode()).hexdigest()
    return GraspContract(
        features=features_name,
        weights=backbone.weights.label if isinstance(backbone, BackboneExtractor) else "",
        head=config.head,
        frames=config.frames,
        tare=config.tare,
        settle=(SETTLE.start, SETTLE.stop),
        cameras=len(pours.pours[0].cameras),
        width=camera.width,
        height=camera.height,
        rate_hz=rate_of(pours.pours[0]),
        rule=options.rule,
        offset=tuple(tuple(map(float, row)) for row in learnt.head.offset),
        factor=tuple(tuple(map(float, row)) for row in learnt.head.factor),
        stability=learnt.stability,
        parameters=parameters,
        data_digest=digest,
        measured={key: value for key, value in measured.items() if np.isfinite(value)},
        software=f"taxel {__version__}",
    )


def _check(
    features: list[FrameFeatures], learnt: LearntMonitor
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return scaled windows of the first pour and what the head gives for them."""
    from taxel.windows.sequence import sequence_windows

    own = features[0].all()
    windows = sequence_windows(learnt.head.scale(own), learnt.head.config.frames)
    part = np.linspace(0, len(windows) - 1, min(_CHECK_WINDOWS, len(windows))).astype(int)
    return np.ascontiguousarray(windows[part]), learnt.head.probabilities(own)[part]
