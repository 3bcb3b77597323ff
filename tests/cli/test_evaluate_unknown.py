"""Claims about what `taxel reproduce unknown-objects` prints and refuses."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from taxel.cli.evaluation.reproduce.unknown_objects import UnknownObjects
from taxel.cli.options.arrays import RecipeOptions
from taxel.errors import BadDataset, BadInput
from taxel.recordings.reader import list_recordings, read_recording
from taxel.recordings.writer import Recorder
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.simulated.data_sets import write_sessions


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short, dry sessions with a prism and rubber among the rest."""
    path = tmp_path_factory.mktemp("unknown") / "set"
    config = TengHandConfig(
        rate_hz=100.0, scans_per_class=9000, sessions=3, humidity_pct=(30.0, 35.0), unknown=True
    )
    write_sessions(path, config, lambda _: None)
    return path


def run_unknown(data: Path, target: str | None = None, **options) -> None:
    """Run the study with three folds."""
    recipe = RecipeOptions(target=target)
    UnknownObjects(data=data, fold_count=3, recipe=recipe, **options).run()


@pytest.mark.slow
def test_values_that_are_never_learned_are_measured_and_printed_as_json(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    run_unknown(folder, "material", json=True, never=("prism", "rubber"))
    (found,) = json.loads(capsys.readouterr().out)
    assert found["target"] == "material"
    assert {auroc["kind"] for auroc in found["aurocs"]} == {"rubber"}
    assert set(found["rejected_by_class"]) == {"aluminium", "glass", "plastic"}


@pytest.mark.slow
def test_each_class_is_left_out_where_none_is_named(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    run_unknown(folder, "shape")
    printed = capsys.readouterr().out
    for name in ("cylinder", "prism", "rectangle", "sphere", "mean", "least"):
        assert name in printed


def test_a_split_that_holds_no_group_out_is_refused(folder: Path):
    with pytest.raises(BadInput, match="whole groups"):
        run_unknown(folder, split="random")


@pytest.mark.slow
def test_files_are_held_out_where_there_are_no_sessions_and_the_share_can_be_set(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Two classes, one never learned; the recipe would hold out sessions."""
    for number, file in enumerate(list_recordings(folder)):
        recording = read_recording(file)
        manifest = replace(recording.manifest, groups={"file": f"f{number}"})
        with Recorder(tmp_path / file.name, manifest) as recorder:
            recorder.write(recording.samples)
            for mark in recording.marks:
                recorder.mark(replace(mark, groups={}))
    with pytest.raises(BadDataset, match="let 0"):
        run_unknown(tmp_path, "material", never=("rubber",), reject_novel=0.001)
    with pytest.raises(BadInput, match="--reject-novel between"):
        run_unknown(tmp_path, "material", never=("rubber",), reject_novel=0.0)
    run_unknown(tmp_path, "material", json=True, never=("rubber",), reject_novel=0.2)
    (found,) = json.loads(capsys.readouterr().out)
    assert found["split"] == "file held out"


def test_a_value_that_no_label_has_is_refused(folder: Path):
    with pytest.raises(BadDataset, match="not learned"):
        run_unknown(folder, "shape", never=("cone",))
