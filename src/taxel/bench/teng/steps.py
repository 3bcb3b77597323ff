"""`taxel bench teng`: the figures that the TENG hand's system promises.

Knows nothing about how they are printed.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from taxel.bench.other_processes import run_code
from taxel.bench.rows import Row, accuracy_row, missing, quietest, row, row_within
from taxel.bench.teng.kill_recorder import kill_often
from taxel.bench.teng.weak import weak_accuracies, weak_paper_accuracies
from taxel.evaluation.checked import check_recipe
from taxel.jobs.running import side_by_side
from taxel.recordings.imports.importing import import_rows
from taxel.recordings.imports.known import glove_rows, icub_rows
from taxel.training.recipes import find_recipe
from taxel.windows.config import GRID_RATE_HZ, TENG_WINDOW

ROUNDS = 5
"""Times that a latency is measured. Source: our choice, docs/decisions/0032."""
KILLS = 20
WEAK_EPOCHS = 20
WEAK_SEEDS = (0, 1, 2)
WEAK = {
    ("shape", "random"): 0.99,
    ("material", "random"): 0.66,
    ("both", "random"): 0.65,
    ("shape", "session"): 0.77,
    ("material", "session"): 0.48,
    ("both", "session"): 0.36,
}
"""Accuracies of a small CNN measured before the simulator was frozen (docs/decisions/0005)."""
GLOVE = {
    "teng-glove": ("8 channels", 0.96),
    "teng-glove-touch": ("5 TENG channels", 0.90),
}
"""Recipe → (channels in words, goal by file)."""
WEAK_PAPER = {"shape": 0.998, "material": 0.999}
ICUB_SEEDS = 5

Measure = Callable[[], list[Row]]


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run: (what, how)."""
    return [
        ("simulator", simulator_speed),
        ("kill -9", kill_losses),
        ("table and memory", table_time),
        ("live path", live_path),
        ("recording's memory", recording_memory),
        ("demo", demo_time),
    ]


def full_steps(data: Path | None) -> list[tuple[str, Measure]]:
    """Return the measurements that take longer than a few minutes."""
    return [
        ("weak baselines", weak_baselines),
        ("teng-glove", lambda: glove(data)),
        ("icub-grasp", lambda: icub(data)),
    ]


def simulator_speed() -> list[Row]:
    """Simulate the thesis's set; values a second against the prototype's."""
    from taxel.sim.teng.hand import TengHandConfig, simulate_sessions

    started = perf_counter()
    values = sum(
        session.samples.values.size
        for session in simulate_sessions(TengHandConfig(rate_hz=GRID_RATE_HZ))
    )
    speed = values / (perf_counter() - started) / 1.2e6
    return [row("sim://teng speed, over the prototype's 1.2 M values/s", speed, "ratio", ">=", 1.0)]


def kill_losses() -> list[Row]:
    """Kill a recorder twenty times."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        lost = kill_often(Path(folder), KILLS)
    return [row(f"kill -9, {KILLS} times: most lost", max(lost), "s", "<=", 0.1)]


def table_time() -> list[Row]:
    """Train Table 4.1 in a process of its own: seconds and memory."""
    code = (
        "import json,resource,sys,tempfile,time;from pathlib import Path;"
        "from taxel.sources.simulated.data_sets import simulate_presets;"
        "from taxel.evaluation.teng.table_4_1 import TengTableConfig,teng_table;"
        "d=Path(tempfile.mkdtemp());simulate_presets(d,('honest',),160000,0);"
        "t=time.perf_counter();"
        "s=teng_table({'honest':d/'honest'},TengTableConfig(models=('cnn1d','cnn2d')));"
        "print(json.dumps([time.perf_counter()-t,"
        "resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss/1024,"
        "{x.task+', '+x.split+', '+c.model:c.pooled.scores.accuracy "
        "for x in s for c in x.columns.values()}]))"
    )
    seconds, memory_mb, accuracies = run_code(code)
    rows = [
        row("Table 4.1, both networks, shape and material, both splits: all of it", seconds,
            "s", "<=", 90.0),
        row("training: memory", memory_mb, "MiB", "<=", 2048.0),
    ]  # fmt: skip
    for name, value in accuracies.items():
        rows.append(accuracy_row(f"sim honest: {name}", value))
    return rows


def live_path() -> list[Row]:
    """A window to a decision, without a pause and at the hand's own pace; memory."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        bundle, recording = _bundle_and_recording(Path(scratch), GRID_RATE_HZ)
        code = (
            "import json,sys;from pathlib import Path;import numpy as np;"
            "from taxel.bundles.reader import read_bundle;"
            "from taxel.live.recogniser import Recogniser;"
            "from taxel.recordings.reader import read_recording;"
            f"r=read_recording(Path({str(recording)!r}));"
            f"g=Recogniser(read_bundle(Path({str(bundle)!r})),r.manifest.sensor);"
            "t=[a.latency_s for i in range(len(r.samples)) for a in g.push(r.samples[i:i+1])];"
            "assert 'torch' not in sys.modules;"
            "print(json.dumps([float(np.median(t))*1e6,"
            "int(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])/1024,len(t)]))"
        )
        command = [sys.executable, "-m", "taxel.cli.main", "live", str(bundle), "sim://teng"]
        at_once, paced = [], []
        for _ in range(ROUNDS):
            at_once.append(run_code(code))
            done = subprocess.run(
                [*command, "--seconds", "20", "--json"], check=True, capture_output=True, text=True
            )
            paced.append(json.loads(done.stdout)[0])
    name = "a window to a decision, median"
    return [
        quietest(f"{name}, scan by scan without a pause, 100 Hz", [each[0] for each in at_once],
                 "µs", 100.0, f"{at_once[0][2]} windows each; the thesis: 40,460 µs"),
        quietest(f"{name}, taxel live at the hand's own pace, 1 kHz",
                 [each["latency_us_median"] for each in paced], "µs", 100.0,
                 f"{paced[0]['windows']} windows each of sim://teng, awake and rehearsed for a "
                 "window's last row (decision 10)"),
        row("live path: memory", max(each[1] for each in at_once), "MiB", "<=", 250.0,
            "no training framework loaded"),
    ]  # fmt: skip


def recording_memory() -> list[Row]:
    """Record ten simulated minutes at 1 kHz: growth of memory after the first minute."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        code = (
            "import json,psutil;from pathlib import Path;import numpy as np;"
            "from taxel.recordings.manifest import Manifest;"
            "from taxel.recordings.writer import Recorder;"
            "from taxel.signals import Samples,SensorInfo;"
            "s=SensorInfo(name='t',channels=tuple(f'c{i}' for i in range(12)),"
            "units=('V',)*12,rate_hz=1000.0);p=psutil.Process();m=[];"
            f"f=Path({str(Path(scratch) / 'ten.mcap')!r});"
            "r=Recorder(f,Manifest.started_now(s,now_s=0.0));"
            "v=np.random.default_rng(0).random((50,12));\n"
            "for i in range(12000):\n"
            "    r.write(Samples.from_values(v,(i*50+np.arange(50))/1000.0));r.flush()\n"
            "    m.append(p.memory_info().rss) if i%1200==1199 else None\n"
            "r.close();print(json.dumps((m[-1]-m[0])/2**20))"
        )
        grown = float(run_code(code))
    return [row("a 10-minute recording at 1 kHz: memory grown after a minute", grown, "MiB",
                "<=", 5.0, "12,000 chunks of 50 ms")]  # fmt: skip


def demo_time() -> list[Row]:
    """Run the demo as a user would."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        started = perf_counter()
        subprocess.run(
            [sys.executable, "-m", "taxel.cli.main", "demo", "--seconds", "0"],
            cwd=scratch,
            check=True,
            capture_output=True,
        )
        seconds = perf_counter() - started
    return [row("taxel demo, after install, until the page opens", seconds, "s", "<=", 90.0)]


def weak_baselines() -> list[Row]:
    """A small CNN on the frozen simulator, against the figures that it was tuned to."""
    each = side_by_side(weak_accuracies, [(seed, WEAK_EPOCHS) for seed in WEAK_SEEDS])
    rows = []
    for (target, split), middle in WEAK.items():
        values = [found[target, split] for found in each]
        note = "seeds " + ", ".join(f"{value:.3f}" for value in values)
        name = f"sim honest, small CNN: {target}, {split} split"
        rows.append(row_within(name, float(np.mean(values)), "accuracy", middle, 0.05, note))
    paper = weak_paper_accuracies(WEAK_EPOCHS)
    for target, middle in WEAK_PAPER.items():
        name = f"sim paper, small CNN: {target}, random split"
        rows.append(row_within(name, paper[target], "accuracy", middle, 0.05))
    return rows


def glove(data: Path | None) -> list[Row]:
    """The glove, by file and by session, on eight channels and on five."""
    if data is None or not (data / "teng-glove").exists():
        why = "no recordings: name their folder with --data"
        return [missing("teng-glove", "accuracy", ">= 0.96", why)]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch) / "glove"
        import_rows(glove_rows(data / "teng-glove"), folder)
        jobs = [(folder, name, key) for name in GLOVE for key in ("file", "session")]
        return side_by_side(_glove_row, jobs)


def _glove_row(folder: Path, name: str, key: str) -> Row:
    """Measure one recipe of the glove under one split; runs in a process of its own."""
    channels, least = GLOVE[name]
    recipe = replace(find_recipe(name), split=f"group:{key}")
    checked = check_recipe(folder, recipe, bars=("minirocket", "extra-trees"))
    low, high = checked.pooled.interval
    note = ", ".join(f"{k} {bar.scores.accuracy:.3f}" for k, bar in checked.bars.items())
    note = f"95 % {low:.3f} … {high:.3f}; {note}; majority {checked.trivial['majority']:.3f}"
    text, value = f"teng-glove, {channels}, split by {key}", checked.pooled.scores.accuracy
    if key == "file":
        return row(text, value, "accuracy", ">=", least, note)
    return accuracy_row(text, value, note)


def icub(data: Path | None) -> list[Row]:
    """The iCub's grasps, tared, trials 1–10 → 11–20."""
    name = "icub-grasp, tared, split by order: trials 1–10 → 11–20"
    if data is None or not (data / "icub-grasp").exists():
        why = "no recordings: name their folder with --data"
        return [missing(name, "accuracy", ">= 0.98", why)]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        folder = Path(scratch) / "icub"
        import_rows(icub_rows(data / "icub-grasp"), folder)
        first, *others = side_by_side(_icub_result, [(folder, s) for s in range(ICUB_SEEDS)])
    values = [first[0], *(value for value, _ in others)]
    note = f"mean of {ICUB_SEEDS} seeds, least {min(values):.2f}; 100 trials; {first[1]}"
    return [row(name, float(np.mean(values)), "accuracy", ">=", 0.98, note)]


def _icub_result(folder: Path, seed: int) -> tuple[float, str]:
    """Return one seed's accuracy and, for the first seed, what stands beside it."""
    recipe = find_recipe("icub-grasp")
    recipe = replace(recipe, train=replace(recipe.train, seed=seed))
    bars = () if seed else ("minirocket", "extra-trees")
    checked = check_recipe(folder, recipe, bars=bars)
    beside = [f"{k} {bar.scores.accuracy:.2f}" for k, bar in checked.bars.items()]
    beside.append(f"length alone {checked.trivial['length of the trial']:.2f}")
    return checked.pooled.scores.accuracy, ", ".join(beside)


def data_digest(data: Path | None) -> str:
    """Return a digest over the contents of the recordings used, file by file in order."""
    import hashlib

    digest = hashlib.sha256()
    for file in sorted((data or Path()).rglob("*")) if data is not None else []:
        if file.is_file() and file.parent.name in ("teng-glove", "iCubGraspDataset"):
            digest.update(file.read_bytes())
    return digest.hexdigest()


def _bundle_and_recording(scratch: Path, rate_hz: float) -> tuple[Path, Path]:
    """Write an untrained bundle and a recording: time does not depend on weights."""
    from taxel.bundles.writer import write_bundle
    from taxel.models.catalogue import find_network
    from taxel.sim.teng.hand import TengHandConfig
    from taxel.sources.simulated.data_sets import write_sessions
    from taxel.training.loop import new_network
    from taxel.training.run import contract_of
    from taxel.windows.dataset import load_dataset
    from taxel.windows.scaling import fit_scaling

    config = TengHandConfig(rate_hz=rate_hz, scans_per_class=20_000, sessions=1)
    write_sessions(scratch / "set", config, lambda _: None)
    dataset = load_dataset(scratch / "set", TENG_WINDOW, target="shape")
    network = new_network(lambda: find_network("cnn2d").build(12, 12, 3), 0)
    windows = dataset.windows
    scaling = fit_scaling("full-scale", windows.values, windows.mask, dataset.sensor.full_scale)
    contract = contract_of(dataset, "shape", "cnn2d", (network,), scaling, {})
    write_bundle(scratch / "b.taxel", (network,), contract, windows.values, windows.mask)
    return scratch / "b.taxel", scratch / "set" / "session-1.mcap"
