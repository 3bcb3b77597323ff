"""Claims about the paper's tables: every row is there, and no cup stands on both sides."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.evaluation.reproduce.transition_tables import TransitionTables
from taxel.cli.options.cameras import WeightOptions
from taxel.errors import BadDataset
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.transitions.data import Judged, cup_folds
from taxel.evaluation.transitions.tables import plan_rows, score_windows

PAPER = ("densenet121", "efficientnet-b0", "resnet50", "resnet101")


def test_every_published_row_is_planned() -> None:
    """Table 1 has eight rows, Table 2 three and Table 3 ten, with their published accuracies."""
    plans = plan_rows(PAPER)
    published = {
        table: sorted(p.published for p in plans if table in p.tables and p.published is not None)
        for table in (1, 2, 3)
    }
    assert published[1] == [87.29, 90.61, 91.71, 92.27, 95.58, 96.13, 96.69, 98.90]
    assert published[2] == [95.03, 97.24, 98.90]
    assert len(published[3]) == 10
    assert len({(p.model, p.frames) for p in plans}) == len(plans)


def test_a_cup_is_never_on_both_sides() -> None:
    cups = np.array(["a", "b", "a", "c", "b"])
    folds = cup_folds(cups)
    assert [fold.name for fold in folds] == ["a", "b", "c"]
    for fold in folds:
        assert not set(cups[fold.train_rows]) & set(cups[fold.test_rows])
        assert len(fold.train_rows) + len(fold.test_rows) == 5
    with pytest.raises(BadDataset, match="at least two"):
        cup_folds(np.array(["a", "a"]))


def judged(right: int, of: int) -> Judged:
    labels = np.zeros(of, np.int8)
    labels[: of // 2] = 1
    found = labels.astype(np.float32)
    found[: of - right] = 1 - found[: of - right]
    return Judged(TrialFold.of("x", np.arange(0), np.arange(1)), (found,), (labels,))


def test_one_fold_has_a_binomial_interval() -> None:
    scores = score_windows([judged(95, 100)])
    assert scores.accuracy == 0.95
    assert scores.interval == pytest.approx((0.888, 0.978), abs=0.002)  # Wilson


def test_several_folds_have_an_interval_over_folds() -> None:
    scores = score_windows([judged(100, 100), judged(60, 100)])
    assert scores.accuracy == 0.8
    assert scores.interval == (0.6, 1.0)


def test_a_model_with_weights_of_its_own_in_the_folder_uses_these_and_no_other_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tmp_path / "resnet50+transformer.safetensors"
    own.write_bytes(b"")
    models = ["resnet50+lstm", "resnet50+transformer", "resnet101+transformer"]
    named = TransitionTables(weights=WeightOptions(weights=tmp_path, threads=2))
    monkeypatch.setenv("TAXEL_WEIGHTS", str(tmp_path))
    by_variable = TransitionTables()

    for verb in (named, by_variable):
        assert verb._sources(models) == {
            "resnet50": ["resnet50+lstm"],
            "resnet50+transformer": ["resnet50+transformer"],
            "resnet101": ["resnet101+transformer"],
        }
        assert verb._weights_of("resnet50+transformer").weights == own
        assert verb._weights_of("resnet50") == verb.weights
    assert named._weights_of("resnet50+transformer").threads == 2


def test_windows_over_an_outage_are_no_part_of_the_scores() -> None:
    """Live gives no answer there, so that they are neither right nor wrong."""
    whole = judged(95, 100)
    (found,), (labels,) = whole.probabilities, whole.labels
    more = np.concatenate([found, np.full(7, np.nan, np.float32)])
    longer = replace(
        whole, probabilities=(more,), labels=(np.concatenate([labels, np.ones(7, np.int8)]),)
    )

    assert score_windows([longer]) == score_windows([whole])
    assert score_windows([longer, whole]) == score_windows([whole, whole])
