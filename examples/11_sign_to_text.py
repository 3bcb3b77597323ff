"""A triboelectric glove's signs to text (TENG thesis, chapter 5), real recordings of teng-glove."""

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.evaluation.checked import check_recipe
from taxel.recordings.imports.importing import import_rows
from taxel.recordings.imports.known import glove_rows
from taxel.training.recipes import find_recipe

WHERE = Path(sys.argv[1] if len(sys.argv) > 1 else os.environ.get("TAXEL_DATA", "."), "teng-glove")


def main() -> None:
    if not WHERE.is_dir():
        print(f"no recordings in {WHERE}: see docs/how-to/real-recordings.md")
        return
    with tempfile.TemporaryDirectory() as name:
        import_rows(glove_rows(WHERE), Path(name) / "glove")
        recipe = replace(find_recipe("teng-glove"), model="extra-trees", split="group:session")
        tested = check_recipe(Path(name) / "glove", recipe, bars=()).predictions
    session = tested.group("session")
    for held in np.unique(session):
        own = session == held
        trials = [tested.probabilities[tested.trial == t] for t in np.unique(tested.trial[own])]
        text = " ".join(tested.classes[each.mean(axis=0).argmax()] for each in trials)
        right = tested.correct[own].mean()
        print(f"session {held}, held out: “{text}”, {right:.3f} of {own.sum()} windows right")
    common = np.bincount(tested.y).max() / len(tested)
    print(f"all: {tested.correct.mean():.3f} of windows right; the commonest sign {common:.3f}")


if __name__ == "__main__":
    main()
