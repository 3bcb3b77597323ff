"""`taxel bench transitions`: the figures that the pair of tactile cameras promises.

Knows nothing about how they are printed.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from taxel.bench.other_processes import most_memory_mb, run_code, run_verb
from taxel.bench.rows import Row, missing, quietest, row
from taxel.bench.transitions import gel_shear
from taxel.bench.transitions.table_steps import table_steps
from taxel.bundles.engine import EngineName, Precision

if TYPE_CHECKING:
    from taxel.training.frames.extractors import BackboneExtractor

PAPER_STEP_MS = 31.84
"""DenseNet121 + LSTM on an RTX 4090. Source: Sensors 2024, 24, 5080, Table 1."""
ROUNDS = 3
"""Times that a latency is measured. Source: our choice, docs/decisions/0032."""
FRAME_S = 1.0 / 60.0
LITE0 = "efficientnet-lite0+lstm"
DENSE = "densenet121+lstm"
Measure = Callable[[], list[Row]]


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run: (what, how)."""
    return [
        ("parameter counts", parameter_counts),
        ("simulator", simulator_speed),
        ("gel as a layer", lambda: gel_shear.speed(run_code)),
        ("steps", steps),
        ("live path", live_path),
        ("slip's live path", slip_live_path),
    ]


def full_steps(data: Path | None) -> list[tuple[str, Measure]]:
    """Return the measurements that take longer than a few minutes."""
    return [
        *table_steps(),
        ("the paper's set, tables, warnings", paper_set),
        ("slips", lambda: slips(data)),
        ("slip signal of real touch", lambda: slip_signal(data)),
        ("slip warnings on real gels", lambda: on_real_gels(data)),
        ("recogniser on real gels", lambda: on_real_gels(data, learned=True)),
        ("short crops on real gels", lambda: on_real_gels(data, learned=True, short=True)),
        ("touch encoder: cost", encoder_cost),
        ("touch encoder: probe", lambda: encoder_probe(data)),
        ("sim to real: grey differences", lambda: sim_to_real("grey differences", data)),
        ("sim to real: touch encoder", lambda: sim_to_real("touch encoder", data)),
        ("sim to real: gel features", lambda: sim_to_real("gel features", data)),
        ("sim to real: CycleGAN", lambda: sim_to_real_painted(data)),
        ("slip warning", slip_warning),
        ("slip-both-gels on all cups", both_gels_warning),
        ("bound of warnings", bound_of_warnings),
        ("warnings on both gels", warnings_on_both_gels),
        ("other grasps on both gels", other_grasps_on_both_gels),
        ("moving grasps on both gels", moving_grasps_on_both_gels),
        ("start of a grasp", grasp_starts),
        ("markers' residual", lambda: gel_shear.residual_rows(data)),
    ]


def parameter_counts() -> list[Row]:
    """Compare the paper's ten parameter counts with ours."""
    from taxel.models.transition import TRANSITION_MODELS

    published = [model for model in TRANSITION_MODELS.values() if model.published]
    equal = sum(model.parameters == model.published.parameters for model in published
                if model.published)  # fmt: skip
    return [row("parameter counts equal to the paper's", equal, "of 10", ">=", 10)]


def simulator_speed() -> list[Row]:
    """Render frames of one pour on one core: images a second, without JPEG."""
    code = (
        "import json,cv2;from time import perf_counter;cv2.setNumThreads(1);"
        "from taxel.sim.pour.cup_pour import CupPourConfig,list_runs;"
        "from taxel.sources.simulated.pour_sets import simulate_videos;n=0;s=0.0\n"
        "for run in list_runs(CupPourConfig())[:4]:\n"
        "    for video in simulate_videos(run,25.0,60.0,6.0)[1]:\n"
        "        t=perf_counter();n+=sum(1 for _ in video.images);s+=perf_counter()-t\n"
        "print(json.dumps(n/s))"
    )
    return [row("sim://cup-pour, 320×240 with markers, one core", float(run_code(code)), "frames/s",
                ">=", 500.0)]  # fmt: skip


def steps() -> list[Row]:
    """Time a step: over the whole window again, one thread; the paper's network, two threads."""
    from taxel.evaluation.transitions.step_times import time_step

    lite = min((time_step(LITE0) for _ in range(ROUNDS)), key=lambda timed: timed.stream_ms)
    rows = [
        row("a streaming step over the whole window again, EfficientNet-Lite0 + LSTM", lite.ratio,
            "ratio", ">=", 7.0, f"{lite.stream_ms:.1f} against {lite.window_ms:.1f} ms, k = 8, "
            "ORT f32, one thread"),
    ]  # fmt: skip
    ways: list[tuple[EngineName, Precision]] = [("onnxruntime", "f32")]
    if find_spec("openvino"):
        ways += [("openvino", "bf16"), ("openvino", "int8")]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        backbones = [_open(DENSE.split("+")[0], *way, Path(scratch)) for way in ways]
    name = "DenseNet121 + LSTM, streaming step, 2 threads"
    for (engine, precision), backbone in zip(ways, backbones, strict=True):
        rounds = [time_step(DENSE, engine=engine, precision=precision, threads=2, repeats=9,
                            extractor=backbone).stream_ms for _ in range(ROUNDS)]  # fmt: skip
        rows.append(quietest(f"{name}, {engine} {precision}", rounds, "ms", PAPER_STEP_MS,
                             "the paper's is an RTX 4090's"))  # fmt: skip
    if len(ways) == 1:
        rows.append(missing(f"{name}, openvino", "ms", f"<= {PAPER_STEP_MS}",
                            "install: pip install 'taxel[openvino]'"))  # fmt: skip
    return rows


def _open(
    backbone: str, engine: EngineName, precision: Precision, scratch: Path
) -> BackboneExtractor:
    from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
    from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run
    from taxel.training.frames.extractors import CameraImages, open_backbone
    from taxel.training.frames.quantising import calibration_frames
    from taxel.windows.camera_recordings import read_camera_recordings

    if precision != "int8":
        return open_backbone(backbone, engine=engine, precision=precision, threads=2)
    config = CupPourConfig()
    write_run(scratch, list_runs(config)[0], config, CAMERA_HZ)
    frames = calibration_frames(read_camera_recordings(scratch))
    return open_backbone(
        backbone,
        engine=engine,
        precision=precision,
        threads=2,
        images=CameraImages(calibration=frames),
    )


def live_path() -> list[Row]:
    """Watch a recording of a pour as live, decoding included: time of a step, memory.

    At the cameras' pace, in the rank and with the memory of a station's monitor: flat out, a
    process in real time is halted for 50 ms of each second.
    """
    (median_ms, longest_ms, moments, memory_mb) = _live_steps()
    name = "EfficientNet-Lite0 + LSTM, a live step, decode included, 99 %"
    how = f"{moments} moments each at 60 a second, 2 threads, ORT"
    return [
        quietest(name, longest_ms, "ms", FRAME_S * 1e3, f"median {median_ms:.1f}; {how} f32"),
        row("live stability path: memory", memory_mb, "MiB", "<=", 600.0,
            "no training framework loaded"),
    ]  # fmt: skip


def _live_steps() -> tuple[float, list[float], int, float]:
    """Return the median, each round's 99 % (ms), moments a round and the most memory (MiB)."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        bundle, recording = _untrained_bundle(Path(scratch))
        code = (
            "import json,sys,numpy as np;from pathlib import Path;"
            "from taxel.live.station.worker import Rank,hurry,settle_memory;hurry(Rank.MODEL);"
            "import cv2;cv2.setNumThreads(1);"
            "from taxel.bundles.grasp import read_grasp_bundle;"
            "from taxel.live.grasp_session import run_grasp_session;"
            "from taxel.sources.opening import open_source;"
            f"b=read_grasp_bundle(Path({str(bundle)!r}),threads=2);"
            f"s=open_source('replay://'+{str(recording)!r});settle_memory();"
            "t=run_grasp_session(s,b);"
            "assert 'torch' not in sys.modules;"
            "m=np.array(t.latencies_s)*1e3;"
            "print(json.dumps([float(np.median(m)),float(np.percentile(m,99)),len(m),"
            "int(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])/1024]))"
        )
        rounds = [run_code(code) for _ in range(ROUNDS)]
    return (
        min(each[0] for each in rounds),
        [each[1] for each in rounds],
        int(rounds[0][2]),
        max(each[3] for each in rounds),
    )


def paper_set() -> list[Row]:
    """Simulate the paper's set, make its tables with our backbone, and warn on unseen cups."""
    from taxel.evaluation.transitions.data import DIFFERENCE
    from taxel.evaluation.transitions.tables import LARGEST_DIFFERENCE

    rows = []
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        cups = Path(scratch) / "cups"
        started = perf_counter()
        run_verb("simulate", "cup-pour", "--output", str(cups), "--json")
        rows.append(row("the paper's 60 videos, both cameras, recorded", perf_counter() - started,
                        "s", "<=", 300.0))  # fmt: skip
        words = ("reproduce", "transition-tables", "--data", str(cups), "--json", "--cache",
                 str(Path(scratch) / "cache"))  # fmt: skip
        peak_mb = most_memory_mb(*words, "--single-split")
        rows.append(row("features of 60 videos and training: memory, all processes", peak_mb, "MiB",
                        "<=", 3072.0))  # fmt: skip
        started = perf_counter()
        tables = run_verb(*words)
        rows.append(
            row("Tables 1 to 3, EfficientNet-Lite0, features cached, every cup held out",
                perf_counter() - started, "s", "<=", 900.0,
                f"{len(tables['rows'])} rows, six trainings each")
        )  # fmt: skip
        lstm = next(r for r in tables["rows"] if r["plan"]["model"] == LITE0
                    and r["plan"]["frames"] == 8)  # fmt: skip
        trivial = {baseline["name"]: baseline for baseline in tables["baselines"]}
        name = "rule change, EfficientNet-Lite0 + LSTM"
        for split, key in (("one cup held out", "single"), ("every cup held out", "every_cup")):
            last, largest = (
                trivial[own][key]["accuracy"] for own in (DIFFERENCE, LARGEST_DIFFERENCE)
            )
            note = f"a difference of pixels: {last:.3f}, the largest of the window {largest:.3f}"
            rows.append(
                row(f"{name}, {split}", lstm[key]["accuracy"], "accuracy", ">=", 0.98, note)
            )
        warned, *trivially = run_verb(
            "reproduce", "grasp-warnings", "--data", str(cups), "--rule", "gross-slip",
            "--features", "gel", "--frames", "30", "--json",
        )  # fmt: skip
    beside = "; ".join(
        f"{baseline['name']} {baseline['windows']['balanced']:.3f}" for baseline in trivially
    )
    events = warned["events"]
    what = "gross slip > 300 µm, gel features + LSTM, every cup held out"
    note = f"{events['runs']} pours, {events['events']} slips, missed {events['missed_share']:.2f}"
    rows += [
        row(f"{what}: balanced accuracy", warned["windows"]["balanced"], "accuracy", ">=", 0.90,
            f"AUC {warned['windows']['auc']:.3f}; {beside}"),
        row(f"{what}: median warning before", events["lead_median_s"], "s", ">=", 0.15, note),
        row(f"{what}: false alarms on pours that hold", events["false_alarms_per_min"], "1/min",
            "<=", 0.5, f"{events['hold_min']:.1f} minutes"),
    ]  # fmt: skip
    return rows


def slips(data: Path | None) -> list[Row]:
    """gelsight-slip by object: the default recogniser."""
    from taxel.bench.transitions.slip_trials import missing_rows, slip_rows

    if data is None or not (data / "gelsight-slip").exists():
        return missing_rows("no recordings: name their folder with --data")
    folder = data / "gelsight-slip"
    found = run_verb("evaluate-trials", str(folder), "--target", "outcome", "--split",
                   "group:object", "--json")  # fmt: skip
    return slip_rows(found)


def slip_signal(data: Path | None) -> list[Row]:
    """gelsight-slip ranked by the slip signal, from which no model learns."""
    from taxel.bench.transitions.slip_trials import missing_signal_rows, signal_rows

    if data is None or not (data / "gelsight-slip").exists():
        return missing_signal_rows("no recordings: name their folder with --data")
    return signal_rows(data / "gelsight-slip")


def on_real_gels(data: Path | None, *, learned: bool = False, short: bool = False) -> list[Row]:
    """Watch real trials with the warnings that come with taxel, or with what learned from some."""
    from taxel.bench.transitions.real_gels import real_gel_rows
    from taxel.bench.transitions.real_recogniser import recogniser_alarm_rows

    return recogniser_alarm_rows(data, short=short) if learned else real_gel_rows(data)


def encoder_cost() -> list[Row]:
    """Count and time the touch encoder beside Lite0 and ResNet50."""
    from taxel.bench.transitions.touch_encoder import cost_rows

    return cost_rows()


def encoder_probe(data: Path | None) -> list[Row]:
    """Probe the touch encoder that comes with taxel beside others."""
    from taxel.bench.transitions.touch_encoder import probe_rows

    return probe_rows(data)


def sim_to_real(features: str, data: Path | None) -> list[Row]:
    """Learn slip from simulated trials, alone and beside real objects, and test on real ones."""
    from taxel.bench.transitions.sim_to_real import sim_to_real_rows

    return sim_to_real_rows(features, data)


def sim_to_real_painted(data: Path | None) -> list[Row]:
    """The same from simulated gels that somebody else's CycleGAN paints."""
    from taxel.bench.transitions.sim_to_real import painted_study_rows

    return painted_study_rows(data)


def slip_live_path() -> list[Row]:
    """Time the slip signal and a monitor on it."""
    from taxel.bench.transitions.slip_warning import live_rows

    return live_rows()


def slip_warning() -> list[Row]:
    """Warn of slip on cups never seen: images are followed once and kept."""
    from taxel.bench.transitions.slip_warning import slip_warning_rows

    return slip_warning_rows()


def both_gels_warning() -> list[Row]:
    """Warn of slip by what was learned on both gels, in the same images of rigid ones."""
    from taxel.bench.transitions.slip_warning import both_gels_rows

    return both_gels_rows()


def bound_of_warnings() -> list[Row]:
    """Judge who knows all but when the pouring ends: what no warning of slip can exceed."""
    from taxel.bench.transitions.slip_bound import bound_rows

    return bound_rows()


def warnings_on_both_gels() -> list[Row]:
    """Warn of slip in the same pours with both versions of the gel, learned on either or both."""
    from taxel.bench.transitions.gel_warning import gel_warning_rows

    return gel_warning_rows()


def other_grasps_on_both_gels() -> list[Row]:
    """Warn of slip in pushes, pours without slip, failing grips and sudden slips, on both gels."""
    from taxel.bench.transitions.gel_kinds import gel_kind_rows

    return gel_kind_rows()


def moving_grasps_on_both_gels() -> list[Row]:
    """Warn of slip in lifts, tilts, carries, hand-overs and collisions, on both gels."""
    from taxel.bench.transitions.gel_kinds import moving_rows

    return moving_rows()


def grasp_starts() -> list[Row]:
    """Find the start of each grasp by the images alone."""
    from taxel.bench.transitions.grasp_start import grasp_start_rows

    return grasp_start_rows()


def data_digest(data: Path | None) -> str:
    """Return a digest over the recordings used: names and sizes."""
    digest = hashlib.sha256()
    for file in sorted((data or Path()).glob("gelsight-slip/trials/*/*/*.avi")) if data else []:
        digest.update(f"{file.parent.name}/{file.name} {file.stat().st_size}".encode())
    return digest.hexdigest()


def _untrained_bundle(folder: Path) -> tuple[Path, Path]:
    """Write a bundle whose head is untrained, and a pour: time does not depend on weights."""
    import numpy as np

    from taxel.bundles.grasp import GraspContract, write_grasp_bundle
    from taxel.decisions.stability import StabilityConfig
    from taxel.models.export_onnx import HeadProbability, export_head
    from taxel.models.sequence import find_head
    from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
    from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run

    config = CupPourConfig()
    run = list_runs(config)[0]
    backbone = _open("efficientnet-lite0", "onnxruntime", "f32", folder)
    write_run(folder, run, config, CAMERA_HZ)
    head = find_head("lstm").build(1000, 8).eval()
    windows = np.random.default_rng(0).normal(size=(4, 8, 2, 1000)).astype(np.float32)
    ones = tuple((1.0,) * 1000 for _ in range(2))
    contract = GraspContract(
        features="efficientnet-lite0", weights="", head="lstm", frames=8, tare="change",
        settle=(9, 24), cameras=2, width=320, height=240, rate_hz=60.0, rule="gross-slip",
        offset=tuple((0.0,) * 1000 for _ in range(2)), factor=ones, stability=StabilityConfig(),
        parameters=0, data_digest="", measured={}, software="bench",
    )  # fmt: skip
    import torch

    with torch.inference_mode():
        expected = HeadProbability(head)(torch.from_numpy(windows)).numpy()
    write_grasp_bundle(folder / "b.taxel", contract, export_head(head, 8, 1000), backbone.model,
                       windows, expected)  # fmt: skip
    return folder / "b.taxel", folder / f"{run.name}.mcap"
