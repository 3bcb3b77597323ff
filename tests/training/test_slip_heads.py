"""What a slip warning learns from, and that its exported heads are those that learned."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.bundles.engine import open_engine
from taxel.bundles.model_check import check_model
from taxel.errors import BadInput
from taxel.gel.rim_slip import WITH_RIM
from taxel.gel.slip_signal import PAIR_FEATURES
from taxel.training.slip.cups import (
    NOISE_CUPS,
    TEST_CUPS,
    TRAINING_CUPS,
    is_learned_from,
    keep_runs,
    mild_bumps,
    other_part,
    paper_part,
    paper_runs,
    training_runs,
    true_pours,
)
from taxel.training.slip.heads import (
    FURTHER_LESS,
    LAYERS_LESS,
    features_of,
    learning_rows,
    new_head,
)
from taxel.training.slip.onnx_graph import linear_model
from taxel.training.slip.pose_noise import add_noise, fit_noise, fit_noises, settle


@pytest.fixture(scope="module")
def pours():
    """Three pours: one is dropped, one slips late or not at all, one holds."""
    return true_pours(paper_runs(31_000)[:3])


def test_a_forecast_is_lowered_on_layers_only_where_both_gels_are_learned_from(pours):
    rigid = [features_of(pour) for pour in pours]
    layers = [replace(found, gel=2) for found in rigid]
    goal = "slip in 0.5 or 1 s"
    (rows, labels, _), (_, alone, _) = (learning_rows(each, goal) for each in (rigid, layers))
    both_rows, both, _ = learning_rows([*rigid, *layers], goal)

    assert np.array_equal(alone, labels)
    assert np.array_equal(both_rows, np.concatenate([rows, rows]))
    assert np.array_equal(both[: len(rows)], labels)
    assert both[len(rows) :] == pytest.approx(labels - LAYERS_LESS)
    whether = learning_rows([*rigid, *layers], "within 1 s")[1]
    assert set(np.unique(whether)) <= {0, 1}


def noisy_copy(pour, gain, white_mm, seed):
    random = np.random.default_rng(seed)
    gels = tuple(
        replace(
            rows,
            object=rows.object * gain + random.normal(0, white_mm, rows.object.shape),
            gel=rows.gel + random.normal(0, white_mm, rows.gel.shape),
        )
        for rows in pour.gels
    )
    return replace(pour, gels=gels)


def test_cups_to_learn_from_and_to_judge_on_are_disjoint():
    assert not set(TRAINING_CUPS) & set(TEST_CUPS)
    assert set(NOISE_CUPS) <= set(TRAINING_CUPS)


def test_parts_of_a_cup_are_its_twelve_pours():
    names = {run.name for part in range(4) for run in paper_part(40_003, part)}
    assert names == {run.name for run in paper_runs(40_003)}
    assert {run.kind for run in other_part(40_003, 0)} == {
        "no-slip pour", "bump", "grip drop", "late slip",
    }  # fmt: skip


def test_poses_kept_are_poses_read(tmp_path, pours):
    runs = paper_runs(31_000)[:1]
    first = keep_runs(tmp_path / "a.npz", runs, lambda _: pours[:1])
    again = keep_runs(tmp_path / "a.npz", runs, lambda _: pytest.fail("it is kept"))
    for gel, other in zip(first[0].gels, again[0].gels, strict=True):
        assert np.array_equal(gel.object, other.object)
        assert np.array_equal(gel.object, pours[0].gels[0].object) or gel is not first[0].gels[0]


def test_poses_that_an_earlier_version_kept_are_found_anew(tmp_path, pours):
    runs = paper_runs(31_000)[:1]
    kept = tmp_path / "a.npz"
    keep_runs(kept, runs, lambda _: pours[:1])
    with np.load(kept) as stored:
        np.savez(kept, **{name: stored[name] for name in stored.files if name != "version"})
    asked = []
    keep_runs(kept, runs, lambda again: asked.append(again) or pours[:1])
    keep_runs(kept, runs, lambda _: pytest.fail("it is kept"))

    assert asked == [runs]


def with_byte(archive: bytes, at: int, value: int) -> bytes:
    """An archive with another byte in each entry of its directory."""
    first, *entries = archive.split(b"PK\1\2")
    changed = [own[: at - 4] + bytes([value]) + own[at - 3 :] for own in entries]
    return b"PK\1\2".join([first, *changed])


@pytest.mark.parametrize("keeps", [
    lambda _: b"", lambda _: b"no archive", lambda own: own[:-40],
    lambda own: own[:900] + bytes(200) + own[1100:],
    lambda own: with_byte(own, 8, 1),  # encrypted, as it seems
    lambda own: with_byte(own, 10, 99),  # packed in an unknown way
])  # fmt: skip
def test_poses_in_a_damaged_file_are_found_anew(tmp_path, pours, keeps):
    runs = paper_runs(31_000)[:1]
    kept = tmp_path / "a.npz"
    keep_runs(kept, runs, lambda _: pours[:1])
    kept.write_bytes(keeps(kept.read_bytes()))
    asked = []
    keep_runs(kept, runs, lambda again: asked.append(again) or pours[:1])
    keep_runs(kept, runs, lambda _: pytest.fail("it is kept"))

    assert asked == [runs]


def test_noise_that_was_put_in_is_found_again(pours):
    """Gain of the turn and noise of an image come back within a tenth."""
    pour = pours[0]  # the one that turns
    worse = [noisy_copy(pour, 0.9, 0.002, seed) for seed in range(4)]
    noises = fit_noise(worse, [pour] * 4)

    assert np.median([n.gain[0, 2] for n in noises]) == pytest.approx(0.9, abs=0.03)
    assert np.median([n.white[0, 0] for n in noises]) == pytest.approx(0.002, rel=0.2)


def test_added_noise_is_the_same_for_a_seed_and_spares_the_truth(pours):
    noise = fit_noises([noisy_copy(pours[0], 0.95, 0.002, 1)], pours[:1])
    one, two = (add_noise(pours[1], noise, np.random.default_rng(5)) for _ in range(2))

    assert np.array_equal(one.gels[0].object, two.gels[0].object)
    assert np.array_equal(one.slip_um, pours[1].slip_um)
    assert not np.array_equal(one.gels[0].object, settle(pours[1].gels[0]).object)


def test_rows_are_labelled_by_what_follows(pours):
    found = [features_of(pour) for pour in pours]
    event_s = pours[0].first_s(300.0)
    assert event_s is not None

    rows, labels, weights = learning_rows(found[:1])
    times = found[0].row_s()
    used = (times >= 0.4) & (times <= event_s + 0.1)

    assert rows.shape == (used.sum(), len(PAIR_FEATURES))
    assert np.array_equal(labels, (event_s - times[used] <= 1.0).astype(int))
    assert weights.max() > weights.min()


def test_a_forecast_is_labelled_by_the_largest_slip_until_each_of_its_times(pours):
    found = features_of(pours[0])
    pour = pours[0]
    event_s = pour.first_s(300.0)
    _, labels, _ = learning_rows([found], "slip in 0.5 or 1 s")
    times = found.row_s()
    times = times[(times >= 0.4) & (times <= event_s + 0.1)]
    assert labels.shape == (len(times), 2)
    for label, ahead_s in zip(labels.T, (0.5, 1.0), strict=True):
        sure = np.abs(times + ahead_s - event_s) > 1 / 60  # a moment of the video
        assert np.array_equal((label > 0)[sure], (times + ahead_s > event_s)[sure])
    assert labels.max() <= np.log(1000 / 300)  # a lost cup counts as 1 mm
    assert labels.min() >= np.log(20 / 300)


@pytest.mark.slow
def test_a_forecast_is_one_half_at_gross_slip():
    random = np.random.default_rng(0)
    rows = random.uniform(-1, 1, size=(3000, len(PAIR_FEATURES))).astype(np.float32)
    head = new_head("forecast")
    head.fit(rows, rows[:, 3:4].astype(float), np.ones(len(rows)))  # e-folds of 300 um
    forecast_um, score = head.slip_um(rows), head.probability(rows)

    there_um = 1000.0 * rows[:, PAIR_FEATURES.index("slip_mean")]
    assert np.array_equal(score > 0.5, forecast_um > 300.0)
    assert (forecast_um >= 0.999 * there_um).all()  # slip that is there is forecast
    learned = forecast_um > 1.001 * there_um
    assert np.corrcoef(np.log(forecast_um[learned]), rows[learned, 3])[0, 1] > 0.95


@pytest.mark.slow
def test_slip_that_is_there_counts_with_the_rims_columns_too():
    """0.45 mm of a straight slide scores 0.84 whatever trees that saw only cups forecast."""
    random = np.random.default_rng(0)
    rows = random.uniform(0, 0.1, size=(600, len(WITH_RIM))).astype(np.float32)
    head = new_head("forecast")
    head.fit(rows, np.full((600, 1), np.log(20 / 300)), np.ones(600))
    slid = rows[:1].copy()
    slid[:, PAIR_FEATURES.index("slip_mean")] = 0.45

    (score,) = open_engine(head.to_onnx()).run(features=slid[:, None, None])

    assert score == pytest.approx(1 / (1 + (0.3 / 0.45) ** 4), abs=1e-4)


@pytest.mark.slow
def test_a_forecast_further_ahead_counts_where_it_is_larger_by_more_than_its_margin():
    random = np.random.default_rng(0)
    rows = random.uniform(-1, 1, size=(3000, len(PAIR_FEATURES))).astype(np.float32)
    rows[:, PAIR_FEATURES.index("slip_mean")] = 0.0
    near = np.full(3000, -1.0)
    far = np.where(rows[:, 3] > 0, 0.5, -1.0)
    head = new_head("forecast")
    head.fit(rows, np.stack([near, far], axis=1), np.ones(3000))

    forecast = np.log(head.slip_um(rows) / 300.0)
    assert np.median(forecast[rows[:, 3] > 0]) == pytest.approx(0.5 - FURTHER_LESS, abs=0.01)
    assert np.median(forecast[rows[:, 3] < 0]) == pytest.approx(-1.0, abs=0.01)


def test_of_sudden_slips_only_what_holds_is_learned_from(pours):
    dropped, held = pours[0], replace(pours[0], slip_um=np.zeros_like(pours[0].slip_um))
    held = replace(held, dropped=np.zeros_like(held.dropped))
    expected = {"pour": True, "grip drop": True, "bump": False, "late slip": False, "carry": False}
    for kind, learned in expected.items():
        assert is_learned_from(replace(dropped, run=replace(dropped.run, kind=kind))) == learned
        assert is_learned_from(replace(held, run=replace(held.run, kind=kind)))


def test_a_training_cup_has_its_pours_the_other_kinds_and_mild_pushes():
    runs = training_runs(30_003)

    assert len(paper_runs(30_003)) == 12
    assert len(runs) > 12 + 8
    assert {run.kind for run in runs} >= {"bump", "late slip", "grip drop", "no-slip pour"}
    assert runs[-len(mild_bumps(30_003)) :] == mild_bumps(30_003) != []


def test_features_hold_nothing_of_the_future(pours):
    """Rows up to a moment are the same where what comes later is another thing."""
    whole = features_of(pours[0])
    gels = tuple(
        replace(g, object=np.where(np.arange(len(g.object))[:, None] > 60, 7.0, g.object))
        for g in pours[0].gels
    )
    other = features_of(replace(pours[0], gels=gels))
    before = int(whole.at[int(np.argmax(pours[0].gels[0].shown > 58))]) - 4

    assert np.array_equal(whole.rows[:before], other.rows[:before])


@pytest.mark.slow
@pytest.mark.parametrize("width", [len(PAIR_FEATURES), len(WITH_RIM)])
@pytest.mark.parametrize("name", ["logistic", "boosting", "forecast"])
def test_an_exported_head_gives_what_the_trained_one_gives(name, width):
    random = np.random.default_rng(0)
    rows = random.normal(size=(1500, width)).astype(np.float32)
    labels = (rows[:, -1] + rows[:, 5] ** 2 > 1).astype(int)
    if name == "forecast":
        labels = np.stack([labels, rows[:, 2] > 0], axis=1)
    head = new_head(name)
    head.fit(rows, labels, np.ones(len(rows)))
    model = head.to_onnx()
    check_model(model)  # as each bundle is, before it opens

    found = open_engine(model).run(features=rows[:, None, None])

    assert found.shape == (len(rows),)
    assert np.abs(found - head.probability(rows)).max() < 1e-5


@pytest.mark.slow
def test_boosted_trees_send_a_missing_value_where_training_did():
    random = np.random.default_rng(1)
    rows = random.normal(size=(900, len(PAIR_FEATURES))).astype(np.float32)
    labels = (rows[:, 2] > 0).astype(int)
    rows[::7, 2] = np.nan
    head = new_head("boosting")
    head.fit(rows, labels, np.ones(len(rows)))

    found = open_engine(head.to_onnx()).run(features=rows[:, None, None])

    assert np.abs(found - head.probability(rows)).max() < 1e-5


def test_a_linear_model_cuts_to_a_share():
    columns = np.zeros(len(PAIR_FEATURES))
    columns[3] = 0.5
    rows = np.zeros((3, 1, 1, len(PAIR_FEATURES)), np.float32)
    rows[:, 0, 0, 3] = (-1.0, 1.0, 9.0)

    assert open_engine(linear_model(columns)).run(features=rows) == pytest.approx([0, 0.5, 1])


def test_an_unknown_head_is_refused():
    with pytest.raises(BadInput, match="boosting"):
        new_head("oracle")  # type: ignore[arg-type]
