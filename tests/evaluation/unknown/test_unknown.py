"""Claims about measuring how well the unknown is told."""

from dataclasses import replace

import numpy as np
import pytest
from make_dataset import make_dataset
from rich.console import Console, RenderableType

from taxel.bench.audit.unknown import glove_rows_of
from taxel.errors import BadDataset
from taxel.evaluation.unknown.objects import (
    UnknownConfig,
    _trivial,
    find_unknown,
    kinds_of,
    leave_each_out,
)
from taxel.evaluation.unknown.scores import COVERAGES, OURS, SCORES, UnknownResult
from taxel.labels.trials import Trial
from taxel.views.tables.unknown import left_out_table, unknown_tables
from taxel.windows.dataset import Dataset

CONFIG = UnknownConfig(target="shape", model="extra-trees")


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    """Classes c0 to c3 at levels 1 to 4 of a channel whose gain varies by 10 % a session."""
    return make_dataset(sessions=5, trials_a_session=12, windows_a_trial=3, classes=4)


@pytest.fixture(scope="module")
def found(dataset: Dataset) -> UnknownResult:
    return find_unknown(dataset, kinds_of(dataset, "shape", ["c3"]), CONFIG)


def relabelled(trial: Trial, **labels: str) -> Trial:
    return replace(trial, labels={**trial.labels, **labels})


def printed(what: RenderableType, width: int) -> list[str]:
    console = Console(width=width)
    with console.capture() as capture:
        console.print(what)
    return capture.get().splitlines()


def test_what_is_beyond_everything_learned_is_found(found: UnknownResult):
    ours = found.auroc("c3")
    assert ours.grasps > 0.8
    assert ours.interval[0] <= ours.grasps <= ours.interval[1]
    assert ours.unknown_grasps == 15
    assert ours.unknown_windows == 45


def test_a_large_probability_says_nothing_about_the_unknown(found: UnknownResult):
    """c3 lies beyond c2, of which a classifier is all the surer."""
    assert found.auroc("c3", "max softmax").grasps < 0.7
    assert found.auroc("c3", "weak touch").windows < 0.5


def test_known_touch_of_other_sessions_is_seldom_called_unknown(found: UnknownResult):
    assert found.known_grasps == 45
    assert found.groups == 5
    assert found.rejected_windows < 0.15
    assert set(found.rejected_by_class) == {"c0", "c1", "c2"}
    mean = np.mean(list(found.rejected_by_class.values()))
    assert mean == pytest.approx(found.rejected_grasps, abs=1e-9)


def test_every_score_has_its_figures_and_every_coverage_its_accuracy(found: UnknownResult):
    assert {auroc.score for auroc in found.aurocs} == set(SCORES)
    for curve in found.curves:
        assert len(curve.windows) == len(curve.grasps) == len(COVERAGES)
        assert 0.8 < curve.windows[0] <= 1.0
    assert len({curve.windows[0] for curve in found.curves}) == 1


@pytest.mark.slow
def test_what_was_never_learned_was_never_learned(dataset: Dataset):
    """Spoiling the unknown trials changes nothing that is said of the known."""
    kinds = kinds_of(dataset, "shape", ["c3"])
    values = dataset.windows.values.copy()
    values[(kinds == "c3")[dataset.trial]] = 9.0
    spoilt = replace(dataset, windows=replace(dataset.windows, values=values))
    before, after = (find_unknown(data, kinds, CONFIG) for data in (dataset, spoilt))
    assert before.curves == after.curves
    assert before.rejected_by_class == after.rejected_by_class


@pytest.mark.slow
def test_each_class_is_left_out_in_turn(dataset: Dataset):
    results, refused = leave_each_out(dataset, CONFIG)
    assert not refused
    assert list(results) == ["c0", "c1", "c2", "c3"]
    assert results["c0"].auroc("c0").grasps > 0.9
    for name, result in results.items():
        assert name not in result.rejected_by_class
        assert result.auroc(name).unknown_grasps == 15


@pytest.mark.slow
def test_a_class_without_which_too_little_is_left_does_not_end_the_others():
    """Of 22 trials 20 are c0's: without them two are left, which calibrate nothing."""
    dataset = make_dataset(sessions=4, trials_a_session=12, windows_a_trial=2)
    rare = [
        trial.labels["shape"] == "c0" or trial.groups["number"] in "23" for trial in dataset.trials
    ]
    trials = tuple(trial if kept else relabelled(trial, shape="c0")
                   for trial, kept in zip(dataset.trials, rare, strict=True))  # fmt: skip
    results, refused = leave_each_out(replace(dataset, trials=trials), CONFIG)
    assert list(results) == ["c1", "c2"]
    assert list(refused) == ["c0"]
    assert "contacts" in refused["c0"]
    lines = printed(left_out_table(results, refused), 110)
    assert any(line.startswith("c0 could not be left out: needed") for line in lines)
    with pytest.raises(BadDataset, match="contacts"):
        leave_each_out(make_dataset(sessions=2, trials_a_session=3), CONFIG)


def test_answers_that_a_constant_one_beats_are_warned_of(found: UnknownResult):
    """The share of the commonest class stands beside the accuracy at each coverage."""
    assert found.majority.grasps[0] == pytest.approx(1 / 3)
    assert found.majority.windows[-1] >= 1 / 3
    assert not any("warning" in line for line in printed(unknown_tables([found]), 110))
    assert found.curves[0].windows[0] < 1.0
    worse = replace(found, majority=found.curves[0])
    assert any("no better than" in line for line in printed(unknown_tables([worse]), 110))


def test_two_classes_are_too_few_to_leave_one_out():
    with pytest.raises(BadDataset, match="three classes"):
        leave_each_out(make_dataset(classes=2), CONFIG)


def test_a_trial_that_is_unknown_by_another_label_only_is_neither(dataset: Dataset):
    trials = tuple(relabelled(trial, material="rubber" if i % 2 else "glass")
                   for i, trial in enumerate(dataset.trials))  # fmt: skip
    mixed = replace(dataset, trials=trials)
    kinds = kinds_of(mixed, "shape", ["c3", "rubber"])
    assert set(kinds[::2]) == {
        "",
    }
    assert set(kinds[1::2]) == {"-"}
    joined = tuple(relabelled(trial, **{"shape+material": " ".join(trial.labels.values())})
                   for trial in trials)  # fmt: skip
    kinds = kinds_of(replace(dataset, trials=joined), "shape+material", ["c3", "rubber"])
    assert set(kinds) == {"", "rubber", "c3+rubber"}


@pytest.mark.slow
def test_what_is_tested_in_every_fold_is_counted_once(dataset: Dataset):
    """Trials in groups of their own: no fold learns from those of c3, each tests them all."""
    found = find_unknown(
        dataset, kinds_of(dataset, "shape", ["c3"]), replace(CONFIG, group="trial", folds=3)
    )
    assert found.auroc("c3").unknown_grasps == 15
    assert found.auroc("c3").unknown_windows == 45


def test_nothing_unknown_is_refused(dataset: Dataset):
    with pytest.raises(BadDataset, match="not learned"):
        find_unknown(dataset, kinds_of(dataset, "shape", ["cone"]), CONFIG)


@pytest.mark.parametrize("left", [0, 1])
def test_fewer_than_two_classes_to_learn_are_refused(dataset: Dataset, left: int):
    """All classes were named, or all but one."""
    kinds = kinds_of(dataset, "shape", dataset.classes("shape")[left:])
    with pytest.raises(BadDataset, match=f"two or more classes to learn; got {left}"):
        find_unknown(dataset, kinds, CONFIG)


@pytest.mark.parametrize("width", [95, 110])
def test_the_tables_hold_every_score_and_the_least_and_no_figure_is_cut(
    found: UnknownResult, width: int
):
    lines = printed(unknown_tables([found]), width) + printed(
        left_out_table({"c3": found}, {}), width
    )
    words = " ".join(lines)
    for score in SCORES:
        assert score in words
    assert f"{found.auroc('c3', OURS).windows:.3f}" in words
    assert any(line.startswith(" least") for line in lines)
    assert "…" not in words


def test_without_recordings_the_glove_is_missing_and_says_why():
    (row,) = glove_rows_of(None)
    assert row.value is None
    assert "--data" in row.note


def test_padding_is_no_weak_touch() -> None:
    """Two windows of one level, of which half of the second is padding."""
    values = np.full((2, 8, 3), 2.0, np.float32)
    mask = np.ones((2, 8), bool)
    values[1, 4:], mask[1, 4:] = 0.0, False
    found = _trivial(values[:1], values, mask[:1], mask)

    assert found["weak touch"].tolist() == [-2.0, -2.0]
    assert found["unusual level"].tolist() == [0.0, 0.0]
