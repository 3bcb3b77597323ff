"""Sort waste by material (TENG thesis, chapter 5): each grasp's class to a bin, by a table."""

import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.evaluation.checked import check_recipe
from taxel.sources.data_sets import simulate_presets
from taxel.training.recipes import find_recipe

BINS = {"aluminium": "metal bin", "glass": "glass bin", "plastic": "plastic bin"}
LEAST = 0.5  # a grasp told with less goes to a person's hands


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        simulate_presets(Path(name), ("honest",), 48_000, 0)
        recipe = replace(find_recipe("teng-referenced"), target="material")
        told = check_recipe(Path(name) / "honest", recipe, bars=()).predictions
    binned, sorted_right, of_session = Counter[str](), Counter[str](), Counter[str]()
    for trial in np.unique(told.trial):
        own = told.trial == trial
        mean = told.probabilities[own].mean(axis=0)
        where = BINS[told.classes[mean.argmax()]] if mean.max() >= LEAST else "sorted by hand"
        session = told.trials[trial].groups["session"]
        binned[where] += 1
        if where != "sorted by hand":
            of_session[session] += 1
            sorted_right[session] += bool(mean.argmax() == told.y[own][0])
    print(", ".join(f"{where}: {count} objects" for where, count in sorted(binned.items())))
    for session, count in sorted(of_session.items()):
        print(f"{session}, held out: {sorted_right[session]} of {count} in the right bin")


if __name__ == "__main__":
    main()
