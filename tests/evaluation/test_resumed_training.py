"""A training that was broken off goes on only with what it had begun to learn from."""

from dataclasses import replace
from pathlib import Path

import pytest
from make_pads import RECIPE, make_pads

from taxel.errors import BadInput
from taxel.evaluation.table_split import GivenSplit, training_part
from taxel.recordings.reader import read_recording
from taxel.recordings.writer import Recorder
from taxel.training import final
from taxel.training.curves import Epoch
from taxel.training.final import train_on_all
from taxel.training.run import Run
from taxel.windows.dataset import Dataset


class BrokenOffError(Exception):
    """What ends a training in these tests."""


def train(
    data: Path, *, resume: bool = False, broken_off: bool = False, table: Path | None = None
) -> Run:
    def part(dataset: Dataset) -> Dataset:
        return training_part(data, dataset, RECIPE.target, GivenSplit(table=table))

    def on_epoch(epoch: Epoch) -> None:
        if broken_off and epoch.number == 2:
            raise BrokenOffError

    return train_on_all(
        data, RECIPE, checkpoints=data.parent / "marks", resume=resume, part=part,
        on_epoch=on_epoch,
    )  # fmt: skip


def break_off(data: Path, table: Path | None = None) -> None:
    with pytest.raises(BrokenOffError):
        train(data, broken_off=True, table=table)


def folds(path: Path, learned: str, tested: str) -> Path:
    path.write_text(f"group:session,side\n{learned},train\n{tested},test\n")
    return path


@pytest.fixture
def pads(tmp_path: Path) -> Path:
    return make_pads(tmp_path / "pads", (1, 2))


def test_it_goes_on_where_nothing_has_changed(pads: Path) -> None:
    break_off(pads)
    assert len(train(pads, resume=True).history) == RECIPE.train.epochs


def test_other_labels_on_the_same_values_are_not_gone_on_with(pads: Path) -> None:
    """Weights that had learned the old labels would be kept under the new ones."""
    break_off(pads)
    for file in sorted(pads.iterdir()):
        recording = read_recording(file)
        manifest = recording.manifest
        other = {"2": "10", "10": "2"}[manifest.labels["level"]]
        file.unlink()
        with Recorder(file, replace(manifest, labels={"level": other})) as recorder:
            recorder.write(recording.samples)
    with pytest.raises(BadInput, match="a checkpoint of this configuration and data"):
        train(pads, resume=True)


def test_another_training_part_of_as_many_trials_is_not_gone_on_with(pads: Path) -> None:
    """The session that is tested now would have been learned from."""
    break_off(pads, folds(pads.parent / "first.csv", "s1", "s2"))
    with pytest.raises(BadInput, match="a checkpoint of this configuration and data"):
        train(pads, resume=True, table=folds(pads.parent / "second.csv", "s2", "s1"))


def test_other_software_is_not_gone_on_with(pads: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    break_off(pads)
    monkeypatch.setattr(final, "code_digest", lambda: "another")
    with pytest.raises(BadInput, match="a checkpoint of this configuration and data"):
        train(pads, resume=True)
