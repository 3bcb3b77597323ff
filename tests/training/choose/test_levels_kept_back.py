"""Levels that follow: trials that are kept back for good have no part in what is usual."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from drifting_sessions import TOUCHES, base_of

from taxel.evaluation.expert import Task, learned_windows, read_and_part
from taxel.evaluation.outer_split import OuterSplit
from taxel.evaluation.table_split import GivenSplit
from taxel.training.choose.base import Base
from taxel.training.choose.candidates import discriminant
from taxel.training.choose.kept_tries import KeptTries
from taxel.training.choose.part import training_part
from taxel.training.choose.preparations import prepare_all
from taxel.training.final import train_on_all
from taxel.training.recipes import find_recipe
from taxel.training.run import contract_of
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import follow_levels, load_dataset
from taxel.windows.joining import follow_apart, join_datasets
from taxel.windows.scaling import Scaling


def kept_back(base: Base) -> tuple[list[int], list[int]]:
    """Return the trials of the first four sessions, and those of the others."""
    last = [trial.groups["session"] in ("s4", "s5") for trial in base.trials]
    return [i for i, own in enumerate(last) if not own], [i for i, own in enumerate(last) if own]


def test_what_a_table_keeps_back_has_no_part_in_the_usual_level(
    drifting: Path, tmp_path: Path
) -> None:
    """And is followed as where a bundle is scored: in time, from that level."""
    table = tmp_path / "folds.csv"
    sides = ("train", "train", "train", "train", "test", "test")
    table.write_text(
        "group:session,side\n" + "".join(f"s{i},{own}\n" for i, own in enumerate(sides))
    )
    split = OuterSplit(given=GivenSplit(table=table))
    base, _ = read_and_part(Task(data=drifting, target="kind", split=split))
    train, test = kept_back(base)
    found = prepare_all(base)[0].followed("session:10")
    alone = follow_levels(found.plain.dataset.only_trials(train), "session:10")
    config = replace(found.plain.dataset.config, level_follow="session:10")
    scored = load_dataset(drifting, config, target="kind", usual=alone.usual)

    assert found.dataset.usual == alone.usual
    assert found.dataset.to_level is not None
    assert alone.to_level is not None
    assert scored.to_level is not None
    assert found.dataset.to_level[train].tolist() == alone.to_level.tolist()
    assert found.dataset.to_level[test].tolist() == scored.to_level[test].tolist()
    assert found.dataset.trials == scored.trials


def test_a_try_at_other_levels_is_not_taken_up(drifting: Path, tmp_path: Path) -> None:
    """The same windows of the same trials, of which others are kept back this time."""
    base = base_of(drifting)
    train, test = kept_back(base)
    kept, candidate = KeptTries(tmp_path / "tries", {}), discriminant("all", 0.5)
    folds = np.arange(len(train), dtype=np.intp) % 2
    here, there = (
        training_part(own, prepare_all(own)[0].followed("session:10"), train, folds, ordered=False)
        for own in (base, replace(base, unseen=frozenset(test)))
    )
    kept.keep(here, candidate, (), np.zeros((int(here.scored.sum()), here.classes)), 1.0)

    assert kept.find(here, candidate, ())[0] is not None
    assert kept.find(there, candidate, ())[0] is None


def test_trials_kept_back_do_not_lower_how_many_windows_a_usual_trial_has(drifting: Path) -> None:
    """More than half of them, here."""
    base = base_of(drifting)
    learned = learned_windows(base, prepare_all(base)[0], range(20, 25))
    none = np.zeros(2, np.float32)
    scaling = Scaling(kind="none", offset=none, factor=none + 1)

    assert contract_of(learned, "kind", "any", (), scaling, {}).trial_windows > 0


def test_a_session_of_the_other_folder_is_none_of_the_first_ones(drifting: Path) -> None:
    """Though both call it alike: its first touch is at the usual level."""
    base = base_of(drifting)
    _, test = kept_back(base)
    groups = {"session": "s0"}
    trials = [replace(own, recording=f"test/{own.recording}", groups={**own.groups, **groups})
              if own.groups["session"] == "s5" else own for own in base.trials]  # fmt: skip
    dataset = replace(base.dataset, trials=tuple(trials))
    unseen = np.isin(np.arange(len(trials)), test)
    found = follow_apart(dataset, "session:10", unseen)

    assert found.to_level is not None
    assert found.to_level[test[TOUCHES]].tolist() == [1.0, 1.0]
    assert found.to_level[test[-1]].tolist() != [1.0, 1.0]
    assert found.trials == tuple(trials)


def test_what_a_recipe_keeps_back_has_no_part_in_the_usual_level(
    drifting: Path, tmp_path: Path
) -> None:
    recipe = find_recipe("teng")
    window = WindowConfig(steps=20, stride=20, gate=None, grid_hz=None, level_follow="session:10")
    training = replace(recipe.train, epochs=1)
    recipe = replace(recipe, model="cnn1d", target="kind", window=window, train=training)
    train, _ = kept_back(base_of(drifting))
    run = train_on_all(drifting, recipe, checkpoints=tmp_path / "checkpoints",
                       part=lambda dataset: dataset.only_trials(train))  # fmt: skip
    measured = load_dataset(drifting, replace(window, level_follow=None), target="kind")
    alone = follow_levels(measured.only_trials(train), "session:10")

    assert run.contract.usual == alone.usual
    assert run.contract.window.level_follow == "session:10"
    assert run.contract.trial_windows == 1


def test_trials_of_the_other_folder_are_tested_in_order_of_time_too(
    drifting: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "s5.mcap").write_bytes((drifting / "s5.mcap").read_bytes())
    first = tmp_path / "first"
    first.mkdir()
    for number in range(5):
        (first / f"s{number}.mcap").write_bytes((drifting / f"s{number}.mcap").read_bytes())
    window = WindowConfig(steps=20, stride=20, gate=None, grid_hz=None, level_follow="session:10")
    learned = load_dataset(first, window, target="kind")
    both = join_datasets(learned, other, "kind")
    last = np.arange(len(both), dtype=np.intp)[-1:]

    assert len(both.trials) == 6 * TOUCHES
    assert both.tested(last).values.tolist() == both.windows[last].values.tolist()
    assert both.tested_level is not None
    assert len(both.tested_level) == len(both.trials)
