"""Claims about the comparison of models and of what cleaning gives, on a small simulated set."""

import io
import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from make_dataset import make_dataset
from rich.console import Console

from taxel.bench.audit import models as audit_models
from taxel.cli.evaluation.reproduce.teng_models import TengModels
from taxel.cli.options.arrays import RecipeOptions
from taxel.evaluation.teng import cleaning_gains, model_comparison
from taxel.evaluation.teng.cleaning_gains import NOTHING, Gain, compare_cleaning, ways_to_train
from taxel.evaluation.teng.model_comparison import (
    COMPARED,
    ComparisonConfig,
    ModelResult,
    TrivialResult,
    compare_models,
    split_windows,
)
from taxel.jobs.running import side_by_side
from taxel.models.catalogue import MODELS
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.augment import Augment
from taxel.training.loop import TrainConfig
from taxel.views.tables.models import cleaning_tables, model_tables
from taxel.windows.config import TENG_WINDOW, WindowConfig

SMALL = ComparisonConfig(
    targets=("shape",), models=("cnn2d", "extra-trees"), train=TrainConfig(epochs=1),
    random_folds=1, workers=1,
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("teng")
    simulate_presets(place, ("honest",), 8_000, 0)
    return place / "honest"


@pytest.fixture(scope="module")
def compared(folder: Path) -> tuple[list[ModelResult], list[TrivialResult], list[str]]:
    lines: list[str] = []
    return *compare_models(folder, SMALL, lines.append), lines


@pytest.fixture(scope="module")
def cleaned(folder: Path) -> Iterator[tuple[list[Gain], list[TrivialResult]]]:
    """Two seeds on one folder, three of the ways."""
    kept = (NOTHING, "wavelet db2", "gain, 30 %")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            cleaning_gains,
            "ways_to_train",
            lambda *given: {k: v for k, v in ways_to_train(*given).items() if k in kept},
        )
        yield compare_cleaning([(folder, 0), (folder, 1)], SMALL)


@pytest.mark.slow
def test_every_model_is_measured_under_both_splits(compared) -> None:  # type: ignore[no-untyped-def]
    results, trivial, lines = compared

    places = [(result.model, result.pooled.split) for result in results]

    assert places == [
        ("cnn2d", "random windows (leaks)"),
        ("extra-trees", "random windows (leaks)"),
        ("cnn2d", "session held out"),
        ("extra-trees", "session held out"),
    ]
    assert [result.parameters for result in results] == [5987, None, 5987, None]
    assert all(result.fold_s > 0 and result.inference_us > 0 for result in results)
    assert {baseline.split for baseline in trivial} == {result.pooled.split for result in results}
    assert "majority" in trivial[0].accuracies
    assert len(lines) == len(results) + len(trivial)


@pytest.mark.slow
def test_each_session_is_held_out_once_and_few_random_folds_are_run(compared) -> None:  # type: ignore[no-untyped-def]
    random, held = compared[0][0].pooled, compared[0][2].pooled

    assert len(random.fold_accuracies) == 1
    assert len(held.fold_accuracies) == 6
    assert held.interval_group == "session"
    assert np.sum(held.scores.confusion) == compared[1][1].windows


@pytest.mark.slow
def test_gains_are_paired_window_by_window(cleaned) -> None:  # type: ignore[no-untyped-def]
    gains, _ = cleaned
    base = gains[0]

    assert base.way == NOTHING
    assert base.difference == 0.0
    assert base.p == 1.0
    for gain in gains[1:]:
        assert gain.difference == pytest.approx(gain.accuracy - base.accuracy)
        assert gain.difference == pytest.approx(np.mean(gain.by_run))
        assert gain.interval[0] <= gain.difference <= gain.interval[1]
    assert len({gain.accuracy for gain in gains}) == 3


@pytest.mark.slow
def test_two_seeds_on_one_folder_are_not_twelve_sessions(cleaned) -> None:  # type: ignore[no-untyped-def]
    """Six sessions told twice are six groups: counted twice they would promise too much."""
    for result in cleaned[0]:
        assert result.groups == 6
        assert len(result.by_run) == 2


def gain(p: float, difference: float, ways: int = 8) -> Gain:
    return Gain("shape", "x", "session held out", 0.8, 0.9, difference, (0.0, 0.1), p, (0.1,), 18,
                ways)  # fmt: skip


def test_a_claim_pays_for_the_ways_that_were_tried() -> None:
    assert gain(0.004, 0.05).verdict == "gives 5.0 points"
    assert gain(0.004, -0.05).verdict == "costs 5.0 points"
    assert gain(0.02, 0.05).verdict == "nothing that 18 groups could show"
    assert gain(0.02, 0.05, ways=1).verdict == "gives 5.0 points"


def test_ways_that_do_not_fit_an_array_are_left_out() -> None:
    plain = replace(SMALL, window=WindowConfig(steps=6, stride=6))

    ways = ways_to_train(make_dataset(), plain)  # four channels, no gate

    assert not {"shift, 1 finger", "segmentation at the gate"} & set(ways)
    assert ways[NOTHING] == (plain.window, Augment())
    assert ways["wavelet db2"][0].wavelet == "db2"


def test_every_way_changes_one_thing_alone() -> None:
    hand = make_dataset()
    hand = replace(hand, sensor=replace(hand.sensor, channels=tuple("abcdefghijkl"),
                                        units=("V",) * 12))  # fmt: skip

    ways = ways_to_train(hand, replace(SMALL, window=TENG_WINDOW))

    assert len(ways) == 9
    for way, (window, augment) in ways.items():
        changed = (window != TENG_WINDOW) + (augment != Augment())
        assert changed == (way != NOTHING)


def test_the_splits_seed_is_the_trainings() -> None:
    dataset = make_dataset()
    first, again, other = (
        split_windows(dataset, replace(SMALL, train=TrainConfig(seed=s)), "shape", "random")
        for s in (1, 1, 2)
    )

    np.testing.assert_array_equal(first.folds[0].test, again.folds[0].test)  # type: ignore[union-attr]
    assert not np.array_equal(first.folds[0].test, other.folds[0].test)  # type: ignore[union-attr]


def test_all_that_is_compared_can_be_found() -> None:
    assert set(COMPARED) <= set(MODELS)


def shown(part: object) -> str:
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(part)
    return console.export_text()


@pytest.mark.slow
def test_tables_show_intervals_splits_and_trivial_baselines(compared, cleaned) -> None:  # type: ignore[no-untyped-def]
    models = shown(model_tables(*compared[:2]))
    cleaning = shown(cleaning_tables(*cleaned))

    assert "random windows (leaks)" in models
    assert "session held out" in models
    assert re.search(r"cnn2d +0\.\d{4} \[0\.\d{3}, \d\.\d{3}\]", models)
    assert "5,987" in models
    assert "majority" in models
    assert "majority" in cleaning
    assert "0.05 / 2" in cleaning


@pytest.mark.slow
def test_rows_name_their_split_and_have_no_goal(compared, cleaned, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(audit_models, "simulate_presets", lambda *_: None)
    monkeypatch.setattr(audit_models, "compare_models", lambda *_: compared[:2])
    monkeypatch.setattr(audit_models, "compare_cleaning", lambda *_: cleaned)

    rows = audit_models.model_rows() + audit_models.cleaning_rows()
    results, trivial, _ = compared

    assert [row.value for row in rows[:4]] == [own.pooled.scores.accuracy for own in results]
    assert [row.value for row in rows[4:6]] == [max(own.accuracies.values()) for own in trivial]
    assert [row.value for row in rows[6:9]] == [own.accuracy for own in cleaned[0]]
    assert len(rows) == 4 + 2 + 3 + 1
    assert len({row.name for row in rows}) == len(rows) - 1  # one trivial row in both lists
    for row in rows:
        assert "session held out" in row.name or "random windows (leaks)" in row.name
        assert row.ok is None
        assert row.goal == ""


@pytest.mark.slow
def test_the_verb_prints_json(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        model_comparison, "side_by_side", lambda work, jobs, on_done, _: side_by_side(
            work, jobs, on_done, workers=1
        ),
    )  # fmt: skip
    study = TengModels(
        data=folder, model="cnn2d", recipe=RecipeOptions(epochs=1), fold_count=6, json=True
    )

    study.run()

    found = json.loads(capsys.readouterr().out)
    assert [entry["model"] for entry in found["models"]] == ["cnn2d"] * 2
    assert math.isfinite(found["models"][1]["pooled"]["interval"][0])
    assert len(found["trivial"]) == 2
