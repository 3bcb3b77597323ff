"""What is held out where no split is named: the same for a recipe and for the default training."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from make_dataset import make_dataset
from make_pads import RECIPE, SENSOR

from taxel.errors import BadSplit
from taxel.evaluation.fold_jobs import Source, open_source
from taxel.evaluation.learning_curve import learning_curve
from taxel.evaluation.outer_split import OuterSplit
from taxel.evaluation.splits import TrialFold, parse_split
from taxel.evaluation.table_split import OWN_SPLIT
from taxel.evaluation.usual_split import recipe_split, usual_split
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples
from taxel.training.choose.base import load_base
from taxel.training.loop import TrainConfig
from taxel.windows.dataset import Dataset

Groups = Callable[[int], dict[str, str]]
UNNAMED = replace(RECIPE, split=None, train=TrainConfig(epochs=1))
GROUPS: dict[str, Groups] = {
    "session": lambda n: {"session": f"s{n // 4}", "object": f"o{n % 4}", "person": f"p{n // 8}"},
    "object": lambda n: {"object": f"o{n % 4}", "person": f"p{n // 8}"},
    "person": lambda n: {"person": f"p{n // 4}", "subject": f"x{n // 2}"},
    "file": lambda n: {"file": f"f{n}"},
    "recording": lambda n: {},
}
"""What is held out → groups of the n-th of 16 trials."""


def record(folder: Path, groups: Groups) -> Path:
    """Write 16 trials of 0.8 s at 100 Hz, each a recording, of two classes in turn."""
    rng = np.random.default_rng(0)
    for n in range(16):
        level = ("2", "10")[n % 2]
        manifest = Manifest.started_now(SENSOR, {"level": level}, groups(n), now_s=0.0)
        values = rng.normal(float(level), 0.5, (80, 2)).astype(np.float32)
        with Recorder(folder / f"t{n:02}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(values, np.arange(80) / 100.0))
    return folder


def regrouped(groups: Groups) -> Dataset:
    """Return 16 trials of two classes in turn with these groups beside recording and trial."""
    dataset = make_dataset(sessions=1, trials_a_session=16, classes=2)
    trials = [
        replace(trial, groups={"recording": f"r{n}", "trial": f"r{n}#0", **groups(n)})
        for n, trial in enumerate(dataset.trials)
    ]
    return replace(dataset, trials=tuple(trials))


@pytest.mark.parametrize("held", GROUPS)
def test_a_recipe_without_a_split_holds_out_what_training_does(held: str, tmp_path: Path) -> None:
    """The same groups are tested together, and none of them is trained on."""
    path = record(tmp_path, GROUPS[held])
    opened = open_source(Source(path=path, recipe=UNNAMED, folds=5, given=OWN_SPLIT))
    base = load_base(path, "level")
    trained = OuterSplit().of(base)

    assert opened.split.name == trained.name == f"{held} held out"
    for fold in opened.split.folds:
        assert isinstance(fold, TrialFold)
        sides = [{opened.dataset.trials[i].groups[held] for i in side}
                 for side in (fold.test, fold.train)]  # fmt: skip
        assert not sides[0] & sides[1]
    if held in ("session", "object"):  # no more of them than folds: each is held out once
        assert [fold.test for fold in opened.split.folds] == [
            fold.test for fold in trained.folds if isinstance(fold, TrialFold)
        ]


def test_sessions_are_held_out_as_they_were_with_the_recipes_own_split() -> None:
    """The very folds of group:session, also of more sessions than folds."""
    for sessions in (3, 8):
        dataset = make_dataset(sessions=sessions)
        named = parse_split("group:session", dataset, "shape", 5, 7)

        assert recipe_split(None, dataset, "shape", 5, 7) == named
        assert usual_split(dataset, "shape", 5, 7) == named


def test_sessions_that_cannot_be_held_out_are_refused_as_before() -> None:
    """A class of one session only: a recipe is not measured on less than new sessions unasked."""
    dataset = make_dataset(sessions=3, one_session_a_class=True)

    for named in (None, "group:session"):
        with pytest.raises(BadSplit, match="at least two groups 'session'"):
            recipe_split(named, dataset, "shape", 3, 0)
    assert recipe_split("group:trial", dataset, "shape", 3, 0).name == "trial held out"


def test_sessions_that_training_cannot_hold_out_are_named_with_the_reason() -> None:
    """Somebody who named sessions must not take an accuracy within them for one of new ones."""
    split = usual_split(make_dataset(sessions=3, one_session_a_class=True), "shape", 3, 0)

    assert split.name == "trial held out"
    (note,) = split.notes
    assert note.startswith("sessions cannot be held out: needed at least two groups 'session' for")
    assert note.endswith("; so trials are, and in a new session accuracy may be lower")


def test_one_session_alone_is_no_reason_to_refuse() -> None:
    """Nothing of it can be held out whole, so the objects within it are."""
    dataset = regrouped(lambda n: {"session": "s", "object": f"o{n % 4}"})

    assert recipe_split(None, dataset, "shape", 5, 0).name == "object held out"
    assert not usual_split(dataset, "shape", 5, 0).notes


def test_where_nothing_can_be_held_out_the_finest_groups_say_why() -> None:
    dataset = regrouped(lambda n: {"person": "p"})
    trials = [replace(trial, labels={"shape": "odd" if n == 0 else "c0"})
              for n, trial in enumerate(dataset.trials)]  # fmt: skip

    message = (
        "at least two trials of every class of 'shape'.*got one of 'odd' .*leave that trial out"
    )
    with pytest.raises(BadSplit, match=message):
        usual_split(replace(dataset, trials=tuple(trials)), "shape", 5, 0)
    figures = [replace(trial, labels={"shape": f"{n / 7}"}) for n, trial in enumerate(trials)]
    with pytest.raises(BadSplit, match=r"of every class .*'shape' looks like a measured figure"):
        usual_split(replace(dataset, trials=tuple(figures)), "shape", 5, 0)


def test_a_class_whose_other_trials_gave_no_window_is_not_said_to_lack_trials() -> None:
    dataset = regrouped(lambda n: {"person": f"p{n % 3}"})
    trials = [replace(trial, labels={"shape": "odd" if n == 0 else "c0"})
              for n, trial in enumerate(dataset.trials)]  # fmt: skip
    lost = replace(trials[0], recording="lost.mcap")

    with pytest.raises(BadSplit, match=r"got one of 'odd' .*: .*window") as caught:
        usual_split(replace(dataset, trials=tuple(trials), empty=(lost,)), "shape", 5, 0)
    assert "record 'odd' again" not in str(caught.value)


def test_a_learning_curve_of_a_recipe_without_a_split_holds_out_the_same(tmp_path: Path) -> None:
    found = learning_curve(record(tmp_path, GROUPS["person"]), UNNAMED, steps=2)

    assert found.split == "person held out"
