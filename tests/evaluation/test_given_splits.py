"""A split that came from elsewhere, from recordings to a bundle's score; nothing of it leaks."""

from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from make_pads import RECIPE, SENSOR, make_pads
from rich.console import Console

from taxel.bundles.reader import Bundle, read_bundle
from taxel.bundles.writer import write_bundle
from taxel.decisions.recognition import UNKNOWN
from taxel.errors import BadDataset, BadSplit, BadTable
from taxel.evaluation.bundle_scores import score_bundle
from taxel.evaluation.checked import Checked, check_recipe
from taxel.evaluation.kept_folds import FoldStore
from taxel.evaluation.learned_recordings import recordings_trained_on
from taxel.evaluation.paired import compare_predictions
from taxel.evaluation.run_scores import judge, only_one
from taxel.evaluation.table_split import GivenSplit, split_elsewhere, training_part
from taxel.labels.class_order import in_order
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import list_recordings
from taxel.recordings.writer import Recorder
from taxel.signals import Samples
from taxel.training.final import train_on_all
from taxel.views.tables.parts import bundle_score_table
from taxel.windows.dataset import Dataset, load_dataset

ONE_SESSION = "only one session was tested: the interval says nothing about other sessions"


@pytest.fixture(scope="module")
def pads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_pads(tmp_path_factory.mktemp("pads") / "pads")


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fourth session, whose files are called as those of the first."""
    return make_pads(tmp_path_factory.mktemp("others") / "others", (1,), seed=9)


@pytest.fixture(scope="module")
def table(pads: Path) -> Path:
    path = pads.parent / "folds.csv"
    path.write_text("group:session,side\ns1,train\ns2,validation\ns3,test\n")
    return path


@pytest.fixture(scope="module")
def bundle(pads: Path, table: Path) -> Bundle:
    """One that was trained on the table's training part."""
    given = GivenSplit(table=table)

    def part(dataset: Dataset) -> Dataset:
        return training_part(pads, dataset, RECIPE.target, given)

    run = train_on_all(pads, RECIPE, checkpoints=pads.parent / "marks", part=part)
    windows = load_dataset(pads, RECIPE.window).windows
    path = pads.parent / "b.taxel"
    write_bundle(path, run.networks, run.contract, windows.values, windows.mask)
    return read_bundle(path)


def checked(pads: Path, given: GivenSplit, **more: object) -> Checked:
    return check_recipe(pads, RECIPE, bars=(), given=given, **more)  # type: ignore[arg-type]


def test_a_table_trains_on_its_training_part_only(pads: Path, table: Path) -> None:
    """Four trials of one session are tested, four learned from, four set aside to choose by."""
    found = checked(pads, GivenSplit(table=table))
    trained = found.predictions.trained[0] > 0
    sessions = np.array([trial.groups["session"] for trial in found.dataset.trials])

    assert found.pooled.split == "folds.csv, session held out"
    assert set(sessions[trained]) == {"s1"}
    assert set(sessions[found.predictions.trial]) == {"s3"}
    assert (found.pooled.windows, found.pooled.trials) == (16, 4)
    assert found.pooled.trial_majority == 0.5


def test_every_class_and_group_has_its_accuracy(pads: Path, table: Path) -> None:
    """Parts of the test add up to the whole; classes that are numbers stand as numbers."""
    pooled = checked(pads, GivenSplit(table=table)).pooled
    assert pooled.parts is not None

    assert [part.name for part in pooled.parts.classes] == ["2", "10"]
    right = sum(part.accuracy * part.windows for part in pooled.parts.classes)
    assert right == pytest.approx(pooled.scores.accuracy * pooled.windows)
    assert pooled.parts.groups == {}  # four trials, four objects, one session


def test_a_folder_to_test_on_is_tested_and_never_trained(pads: Path, others: Path) -> None:
    """Files that are called alike are other trials."""
    found = checked(pads, GivenSplit(test=others))
    tested = {found.dataset.trials[i].recording for i in found.predictions.trial}

    assert tested == {f"test/s1_{name}_{n}.mcap" for name in ("2", "10") for n in (0, 1)}
    assert len(found.dataset.trials) == 16
    assert found.pooled.trials == 4
    trained = found.predictions.trained[0] > 0
    assert not any(found.dataset.trials[i].recording in tested for i in np.flatnonzero(trained))


def test_the_very_recordings_cannot_be_tested_too(pads: Path) -> None:
    """The same values under whatever name are refused in one line."""
    with pytest.raises(BadDataset, match="which holds the values of s1_10_0"):
        checked(pads, GivenSplit(test=pads))


def test_a_table_and_a_folder_exclude_each_other(pads: Path, table: Path) -> None:
    with pytest.raises(BadSplit, match="got both"):
        checked(pads, GivenSplit(table=table, test=pads))


def test_a_changed_table_is_not_answered_from_kept_folds(
    pads: Path, table: Path, tmp_path: Path
) -> None:
    """Folds of a run that was broken off are of its own sides only."""
    checked(pads, GivenSplit(table=table), keep=FoldStore(tmp_path / "kept"))
    assert checked(pads, GivenSplit(table=table), keep=FoldStore(tmp_path / "kept")).kept == 1
    other = tmp_path / "folds.csv"
    other.write_text("group:session,side\ns2,train\ns3,test\n")

    assert checked(pads, GivenSplit(table=other), keep=FoldStore(tmp_path / "kept")).kept == 0


@pytest.mark.slow
def test_comparators_are_fitted_once_for_a_data_set_and_split(pads: Path, tmp_path: Path) -> None:
    """Another model on the same folds takes them from the cache; another split does not."""
    bars = ("extra-trees",)
    first = check_recipe(pads, RECIPE, folds=3, bars=bars, keep=FoldStore(cache=tmp_path))
    other = replace(RECIPE, train=replace(RECIPE.train, epochs=2))
    second = check_recipe(pads, other, folds=3, bars=bars, keep=FoldStore(cache=tmp_path))

    assert (first.cached, second.cached) == (0, 3)
    assert second.bars["extra-trees"] == first.bars["extra-trees"]
    assert check_recipe(pads, other, folds=2, bars=bars, keep=FoldStore(cache=tmp_path)).cached == 0


def test_a_bundle_is_scored_by_window_trial_class_and_group(bundle: Bundle, others: Path) -> None:
    """All figures are of its own decisions; a session that it never saw is a test."""
    found = score_bundle(bundle, others)

    assert (found.windows, found.trials) == (16, 4)
    assert found.majority == found.trial_majority == 0.5
    assert sum(sum(row.values()) for row in found.confusion.values()) == 16
    assert list(found.confusion) == list(in_order(found.confusion))
    right = sum(found.confusion[name].get(name, 0) for name in found.confusion)
    assert found.accuracy == right / 16
    assert found.learned_from == ()
    assert found.learned_is_known


def test_a_bundle_on_new_objects_is_judged_over_objects(bundle: Bundle, tmp_path: Path) -> None:
    """Trials of one object are alike; those that it was trained on are tested in new sessions."""
    sessions = (4, 5, 6, 7, 8)
    new = score_bundle(bundle, make_pads(tmp_path / "new", sessions, seed=4, series="x"))
    known = score_bundle(bundle, make_pads(tmp_path / "known", sessions, seed=4))

    assert (new.interval_group, new.interval_groups) == ("object", 4)
    assert (known.interval_group, known.interval_groups) == ("session", 5)


def test_a_bundle_says_when_it_learned_from_the_very_recordings(bundle: Bundle, pads: Path) -> None:
    """Only those of the table's training part, whatever else lies in the folder."""
    found = score_bundle(bundle, pads)

    assert found.learned_from == ("s1_10_0.mcap", "s1_10_1.mcap", "s1_2_0.mcap", "s1_2_1.mcap")


def test_a_recording_that_gave_no_window_is_none_that_was_trained_on(tmp_path: Path) -> None:
    """Ten rows make no window of twelve: nothing was learned from them."""
    folder = make_pads(tmp_path / "pads", (1,))
    manifest = Manifest.started_now(SENSOR, {"level": "2"}, {"session": "s1"}, now_s=0.0)
    with Recorder(folder / "short.mcap", manifest) as recorder:
        recorder.write(Samples.from_values(np.full((10, 2), 2.0), np.arange(10) / 100.0))
    run = train_on_all(folder, RECIPE, checkpoints=tmp_path / "marks")

    assert len(list_recordings(folder)) == 5
    assert len(recordings_trained_on(run.contract, list_recordings(folder))) == 4


def test_unknown_is_no_answer_and_right_for_what_was_never_learned(
    bundle: Bundle, tmp_path: Path
) -> None:
    """Of a class that the bundle lacks, every answer but UNKNOWN is wrong."""
    other = make_pads(tmp_path / "strange", (5,), ("2", "6"))
    found = score_bundle(bundle, other)
    answers = found.confusion["6"]

    (part,) = [part for part in found.parts.classes if part.name == "6"]
    assert part.accuracy == answers.get(UNKNOWN, 0) / part.windows


def test_a_table_of_groups_is_resampled_by_the_group_that_it_holds_out(tmp_path: Path) -> None:
    """Objects that were touched in several sessions: by object, as under group:object."""
    folder = make_pads(tmp_path / "pads", (1, 2))
    table = tmp_path / "objects.csv"
    table.write_text("group:object,side\n2-0,train\n10-0,train\n2-1,test\n10-1,test\n")
    found = checked(folder, GivenSplit(table=table))
    judged = judge(found.predictions)

    assert found.pooled.split == "objects.csv, object held out"
    assert (found.pooled.interval_group, judged.group) == ("object", "object")
    assert compare_predictions(found.predictions, found.predictions, "level").group == "object"
    assert judged.intervals["object"].groups == 2


def test_a_single_tested_session_says_nothing_about_others(
    pads: Path, table: Path, others: Path, bundle: Bundle
) -> None:
    """A run, a comparison and a bundle's score each say so beside their interval."""
    found = checked(pads, GivenSplit(table=table)).predictions
    judged, scored = judge(found), score_bundle(bundle, others)
    paired = compare_predictions(found, found, "level")
    console = Console(width=120, record=True, file=StringIO())
    console.print(bundle_score_table(scored, "b.taxel", "others"))

    assert (judged.group, judged.lone) == ("recording", "session")
    assert only_one(judged.lone, judged.group) == ONE_SESSION
    assert "Only one session was tested" in paired.verdict
    assert ONE_SESSION in console.export_text()
    assert only_one(judge(checked(pads, GivenSplit()).predictions).lone, "session") is None
    assert str(only_one("body", "session")).endswith("says nothing about other bodies")
    assert only_one("cut_from", "session") == (
        "only one file was tested: the interval says nothing about other files"
    )


def test_objects_that_a_table_puts_on_both_sides_are_counted(pads: Path, tmp_path: Path) -> None:
    """A table of recordings; one of sessions says by itself that objects are known."""
    folds = tmp_path / "folds.csv"
    names = sorted(path.stem for path in pads.glob("*.mcap"))
    folds.write_text(
        "recording,side\n" + "".join(f"{n},{'test' if n[:2] == 's3' else 'train'}\n" for n in names)
    )
    dataset = load_dataset(pads, RECIPE.window)
    notes = split_elsewhere(pads, dataset, RECIPE.target, GivenSplit(table=folds))[0].notes
    folds.write_text("group:session,side\ns1,train\ns2,train\ns3,test\n")
    silent = split_elsewhere(pads, dataset, RECIPE.target, GivenSplit(table=folds))[0].notes

    assert [note for note in notes if "4 of 4 tested objects are on both sides" in note]
    assert not [note for note in silent if "both sides" in note]


def test_a_moment_that_no_trial_holds_is_refused_whoever_reads_the_table(
    pads: Path, bundle: Bundle, tmp_path: Path
) -> None:
    """By a recipe, and for a bundle, beside rows of recordings that are elsewhere."""
    folds = tmp_path / "folds.csv"
    folds.write_text("recording,start_s,side\ns1_2_0,,train\ns2_10_0,,train\n"
                     "s3_2_0,9999,test\ns3_10_0,,test\n")  # fmt: skip
    with pytest.raises(BadTable, match=r"as s3_2_0 lasts; got 9999 s in folds\.csv, line 4"):
        checked(pads, GivenSplit(table=folds))
    folds.write_text("recording,start_s,side\nnowhere,5,train\ns3_2_0,9999,test\n")
    with pytest.raises(BadTable, match=r"got 9999 s in folds\.csv, line 3; give start_s on"):
        score_bundle(bundle, pads, folds=folds)
