"""Sort waste by material (TENG thesis, chapter 5): each grasp's class to a bin, by a rule table."""

import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.actions.rule_table import read_rules
from taxel.evaluation.checked import check_recipe
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.recipes import find_recipe

RULES = Path(__file__).with_name("bins.csv")  # the same file runs live: taxel live … --rules


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        simulate_presets(Path(name), ("honest",), 48_000, 0)
        recipe = replace(find_recipe("teng-referenced"), target="material")
        tested = check_recipe(Path(name) / "honest", recipe, bars=()).predictions
    rules = read_rules(RULES, {"material": tested.classes})
    binned, sorted_right, of_session = Counter[str](), Counter[str](), Counter[str]()
    for trial in np.unique(tested.trial):
        own = tested.trial == trial
        mean = tested.probabilities[own].mean(axis=0)
        where = rules.action("material", tested.classes[mean.argmax()], mean.max())
        session = tested.trials[trial].groups["session"]
        binned[where or "sorted by hand"] += 1
        of_session[session] += bool(where)
        sorted_right[session] += bool(where) and bool(mean.argmax() == tested.y[own][0])
    print(", ".join(f"{where}: {count} objects" for where, count in sorted(binned.items())))
    for session, count in sorted(of_session.items()):
        print(f"{session}, held out: {sorted_right[session]} of {count} in the right bin")


if __name__ == "__main__":
    main()
