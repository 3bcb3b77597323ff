"""An action of one's own: plain Python, called with every decision; no hardware needed."""

import tempfile
from collections import Counter
from pathlib import Path

from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import write_bundle
from taxel.decisions.recognition import UNKNOWN, Decision
from taxel.live.recogniser import Recogniser
from taxel.sources.opening import open_source
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.final import train_on_all
from taxel.training.recipes import find_recipe
from taxel.windows.dataset import load_dataset


def act(decision: Decision) -> str:
    """Say what a gripper should do; not knowing is a reason to stop, never to go on."""
    if decision.label == UNKNOWN:
        return "hold still"
    return "grip softly" if decision.label == "sphere" else "grip firmly"


with tempfile.TemporaryDirectory() as name:
    data, bundle, recipe = Path(name) / "honest", Path(name) / "b.taxel", find_recipe("teng")
    simulate_presets(Path(name), ("honest",), 32_000, 0)
    run = train_on_all(data, recipe, checkpoints=Path(name) / "checkpoints")
    windows = load_dataset(data, recipe.window).windows[:100]
    write_bundle(bundle, run.networks, run.contract, windows.values, windows.mask)
    with open_source("sim://teng?seed=1&seconds=30&speed=max") as source:
        recogniser, done = Recogniser(read_bundle(bundle), source.info), Counter[str]()
        while not source.ended:
            done.update(act(answer.decision) for answer in recogniser.push(source.read()))

print(", ".join(f"{action}: {count} windows" for action, count in done.most_common()))
