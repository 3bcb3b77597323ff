"""Choosing looks at no test trial, holds out what the split holds out, and keeps to its time."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from taxel.errors import BadDataset, BadInput, BadSplit
from taxel.evaluation import expert as expert_module
from taxel.evaluation.expert import Task, measure, train_expert
from taxel.evaluation.outer_split import OuterSplit
from taxel.evaluation.table_split import GivenSplit
from taxel.models.blend import Blend, read_plan
from taxel.models.kernel_features import KERNELS, KernelFeatures
from taxel.training.choose.base import Base, load_base
from taxel.training.choose.budget import TRYING, Budget
from taxel.training.choose.candidates import Candidate, feature_sets, first_round
from taxel.training.choose.choice import Member, read_choice, write_choice
from taxel.training.choose.costs import Cost
from taxel.training.choose.fit_choice import fit_choice
from taxel.training.choose.inner_folds import Held
from taxel.training.choose.kept_tries import KeptTries
from taxel.training.choose.limits import Limits, fit_within
from taxel.training.choose.preparations import Prepared, candidate_windows, prepare, prepare_all
from taxel.training.choose.search import Effort, choose

RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def base(recordings: Path) -> Base:
    return load_base(recordings, "kind")


def test_rows_themselves_are_features_only_of_windows_without_padding():
    """Zeros of padding would show how long a trial was; means over its parts do not."""
    whole, padded = feature_sets(12, 6), feature_sets(12, 6, padded=True)

    assert {"rows", "both rows", "rows without level"} <= set(whole)
    assert not any("rows" in name for name in padded)
    assert {"both parts", "all with parts"} <= set(padded)
    assert "both parts" not in whole  # twelve rows are finer than sixteen parts
    assert "rows" not in feature_sets(400, 8)


def test_a_trials_start_is_a_set_of_its_own_where_windows_begin_with_trials(base: Base):
    """Of channels that drift a discriminant on 75 rows named .57, on the first ones .83."""
    assert "start" not in feature_sets(30, 4)
    assert feature_sets(30, 4, padded=True, starts=True)["start"] == ("start",)
    assert "start" not in feature_sets(15, 4, starts=True)  # a start is not half of a window

    assert [own.starts for own in prepare_all(base)] == [True]
    long = replace(base, rows=np.full(len(base.rows), 900, np.intp))
    (config,) = candidate_windows(base)
    assert not prepare(long, config, config.steps).starts


def test_a_short_trial_is_one_window_without_a_gate(base: Base):
    (config,) = candidate_windows(base)

    assert (config.steps, config.gate, config.grid_hz) == (30, None, None)


def test_long_trials_are_cut_in_ways_that_a_bundle_can_hold(base: Base):
    """Lengths come from NumPy; what a contract keeps are plain values, fit for JSON."""
    long = replace(base, rows=np.linspace(300, 3000, len(base.rows)).astype(np.intp))

    found = candidate_windows(long)

    assert [config.steps for config in found] == [400, 100, 25]
    assert [config.pad for config in found] == [True, False, False]
    assert json.dumps([asdict(config) for config in found])


def test_a_knock_is_a_window_as_a_whole_however_many_rows_a_microphone_gives(base: Base):
    """40,000 rows of 2.5 s: of windows of 400 rows nearly all would hold nothing of the knock."""
    rows = np.full(len(base.rows), 40_000)
    sensor = replace(base.dataset.sensor, rate_hz=16_000.0)
    heard = replace(base, rows=rows, dataset=replace(base.dataset, sensor=sensor))

    assert [config.steps for config in candidate_windows(heard)] == [40_000, 400, 100, 25]
    slow = replace(base, rows=rows)  # the same at 50 Hz takes 13 minutes
    assert [config.steps for config in candidate_windows(slow)] == [400, 100, 25]


class Frozen:
    """A clock that goes on by a second at each look."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1.0
        return self.now


def search(base: Base, train: list[int], seconds: float, kept: KeptTries | None = None):
    budget = Budget(seconds / TRYING, 1, Frozen(), at_once=1)
    effort = Effort(budget=budget, kept=kept or KeptTries(None, {}))
    return choose(base, prepare_all(base), train, Held("session"), effort)


def test_labels_of_test_trials_change_nothing(base: Base):
    """The choice from eight trials is the same where those of all others are swapped."""
    train = list(range(12))
    swapped = [
        replace(trial, labels={"kind": "xy"[trial.labels["kind"] == "x"]})
        if i not in train
        else trial
        for i, trial in enumerate(base.trials)
    ]
    other = replace(base, dataset=replace(base.dataset, trials=tuple(swapped)))

    assert search(base, train, 15.0).choice() == search(other, train, 15.0).choice()


def test_what_the_time_does_not_allow_is_left_out_and_said(base: Base):
    found = search(base, list(range(16)), 5.0)

    assert len(found.board) >= 2
    assert found.left_out


def test_without_any_time_a_discriminant_logistic_regression_and_trees_are_tried(base: Base):
    """Classes that lie around one another no linear model parts."""
    found = search(base, list(range(16)), 0.0)

    families = [tried.candidate.family for *_, tried in found.board]
    assert families == ["discriminant", "linear", "trees"]
    assert found.left_out


@pytest.mark.slow
def test_an_interrupted_choice_goes_on_where_it_was(base: Base, tmp_path: Path):
    first = KeptTries(tmp_path / "t", {})
    trial = search(base, list(range(16)), 12.0, first)
    second = KeptTries(tmp_path / "t", {})
    again = search(base, list(range(16)), 12.0, second)

    assert first.used == 0
    assert second.used == len(trial.board)
    assert [t.loss for _, _, t in again.board[: len(trial.board)]] == [
        t.loss for _, _, t in trial.board
    ]
    search(base, list(range(16)), 12.0, first)
    assert first.used == 0  # its own tries are none of an earlier run


def unjudged(recordings: Path) -> Task:
    """Train only: no outer folds."""
    return Task(data=recordings, target="kind", check=False)


@pytest.fixture(scope="module")
def expert(recordings: Path):
    return train_expert(Task(data=recordings, target="kind"), Limits(minutes=0.05))


def test_by_default_another_session_is_recognised_and_its_bundle_equals_it(expert):
    assert expert.nested.split == "session held out"
    assert expert.nested.scores.scores.accuracy > 0.9
    assert expert.measured.mb < 20
    assert expert.measured.parity < 1e-5


def test_a_time_above_the_limit_is_measured_again_and_the_least_counts(
    expert, base: Base, monkeypatch: pytest.MonkeyPatch
):
    windows = prepare_all(base)[0].dataset.windows
    times = [2600.0, 2100.0, 1900.0, 1800.0]
    monkeypatch.setattr(expert_module, "quietest_us", lambda *_: times.pop(0))
    monkeypatch.setattr(expert_module, "sleep", lambda _: None)

    assert measure(expert.run, windows, 2000.0).us == 1900.0
    assert times == [1800.0]
    assert measure(expert.run, windows, 2000.0).us == 1800.0
    times += [2600.0, 2400.0, 2500.0, 2300.0, 1.0]
    assert measure(expert.run, windows, 2000.0).us == 2300.0  # it is not measured for ever


def test_one_training_part_is_chosen_for_once_and_its_own_choice_is_scored(
    recordings: Path, tmp_path: Path
):
    table = tmp_path / "folds.csv"
    sides = {"s0": "unused", "s1": "train", "s2": "train", "s3": "test"}
    table.write_text("group:session,side\n" + "".join(f"{s},{o}\n" for s, o in sides.items()))
    messages: list[str] = []

    found = train_expert(
        Task(data=recordings, target="kind", split=OuterSplit(given=GivenSplit(table=table))),
        Limits(minutes=0.05), on_step=messages.append,
    )  # fmt: skip

    assert found.nested.choices == (found.choice,)
    assert [line for line in messages if line.startswith(("choosing", "training", "test"))] == [
        "choosing on the training part", "training what was chosen on the training part",
    ]  # fmt: skip
    assert found.nested.scores.scores.accuracy > 0.9
    assert [note for note in found.notes if "no side" in note] == [
        "4 of 16 trials stand on no side of folds.csv, session held out: left out"
    ]


@pytest.mark.slow
def test_a_choice_that_was_written_can_be_repeated(expert, recordings: Path, tmp_path: Path):
    write_choice(tmp_path / "expert.json", expert.choice)
    like = read_choice(tmp_path / "expert.json")

    again = train_expert(Task(data=recordings, target="kind"), like=like)

    assert like == expert.choice
    assert again.run.contract.window == expert.run.contract.window
    assert again.nested.fixed
    assert again.nested.split == expert.nested.split
    assert train_expert(unjudged(recordings), like=like).nested is None


def test_a_damaged_choice_is_refused_in_one_line(tmp_path: Path):
    (tmp_path / "expert.json").write_text('{"format": 1}')
    with pytest.raises(BadInput, match=r"expert\.json"):
        read_choice(tmp_path / "expert.json")


def test_a_member_that_does_not_fit_is_replaced_and_the_loss_is_known(base: Base):
    found = search(base, list(range(16)), 20.0)
    whole = found.choice()
    heavy = whole.members[-1].candidate

    less = found.choice([heavy])

    assert heavy not in [member.candidate for member in less.members]
    assert sum(member.weight for member in less.members) == pytest.approx(1.0)
    assert (whole.accuracy, less.accuracy) == (1.0, 1.0)  # the others know the kinds as well
    assert less.loss != whole.loss


def test_a_split_of_single_windows_is_refused(recordings: Path):
    with pytest.raises(BadSplit, match="a split of whole trials"):
        train_expert(Task(data=recordings, target="kind", split=OuterSplit(named="random")))


@pytest.mark.slow
def test_novel_touch_is_rejected_by_a_default_recogniser_where_asked(recordings: Path):
    limits = Limits(minutes=0.02)

    found = train_expert(unjudged(recordings), limits, reject_novel=0.2)

    assert found.run.contract.unknown is not None
    assert found.run.contract.unknown.rejected == 0.2
    assert found.run.contract.joining == found.choice.joining
    with pytest.raises(BadDataset, match="at least 999 contacts"):
        train_expert(unjudged(recordings), limits, reject_novel=0.001)


@pytest.mark.slow
def test_of_a_bundle_that_is_too_large_members_are_given_up_one_by_one(recordings: Path):
    limits = Limits(minutes=0.05, most_mb=1e-3)

    found = train_expert(unjudged(recordings), limits)

    assert len(found.choice.members) == 1


@pytest.mark.slow
def test_a_chosen_network_is_two_of_other_seeds_that_share_its_weight(base: Base):
    (prepared, *_) = prepare_all(base)
    network = Member(
        candidate=Candidate("network", "touchnet", ""), blocks=(), weight=0.6, sharpness=1.0
    )
    linear = Member(
        candidate=Candidate("linear", "logistic", "means", 1.0), blocks=("mean",), weight=0.4,
        sharpness=2.0,
    )  # fmt: skip
    found = search(base, list(range(16)), 12.0).choice()
    choice = replace(found, members=(network, linear), window=prepared.config)

    blend = fit_choice(choice, base, prepared, list(range(16)))

    plan = read_plan(bytes(blend.plan.tolist()))
    assert [part.head for part in plan.parts] == ["network:touchnet"] * 2 + ["linear"]
    np.testing.assert_allclose(blend.weights.numpy(), [0.3, 0.3, 0.4], atol=1e-6)
    first, second = (dict(head.named_parameters()) for head in blend.heads[:2])
    assert any(not torch.equal(first[name], second[name]) for name in first)


@pytest.mark.slow
def test_a_network_sees_the_mean_of_rows_where_windows_are_long(
    base: Base, monkeypatch: pytest.MonkeyPatch
):
    """A blend that is loaded gives what the trained one gives."""
    monkeypatch.setattr("taxel.training.choose.networks.LONG_ROWS", 10)
    (prepared, *_) = prepare_all(base)
    network = Member(
        candidate=Candidate("network", "touchnet", ""), blocks=(), weight=1.0, sharpness=1.0
    )
    found = search(base, list(range(16)), 12.0).choice()
    choice = replace(found, members=(network,), window=prepared.config)
    steps = prepared.config.steps

    blend = fit_choice(choice, base, prepared, list(range(16)))
    loaded = Blend()
    loaded.load_state_dict(blend.state_dict())
    values = torch.from_numpy(prepared.dataset.windows.values[:5])
    mask = torch.from_numpy(prepared.dataset.windows.mask[:5])

    assert steps >= 20
    assert read_plan(bytes(blend.plan.tolist())).parts[0].head == f"network:touchnet/{steps // 10}"
    with torch.inference_mode():
        assert torch.equal(blend(values, mask), loaded.eval()(values, mask))


@pytest.mark.slow
def test_a_bundle_beyond_its_limits_says_so(recordings: Path):
    found = train_expert(unjudged(recordings), Limits(minutes=0.02, most_us=1.0))

    assert any("more than --max-us 1" in note for note in found.notes)


@pytest.mark.slow
def test_the_bare_model_leaves_time_for_the_bundle(base: Base):
    """What is timed bare stays below the limit by what the bundle's own checks take."""
    found = search(base, list(range(16)), 90.0)

    def cost(blend: Blend, prepared: Prepared) -> Cost:
        return Cost(1.0, 1000.0 * len(blend.features))

    at_limit = fit_within(found, list(range(16)), Limits(most_us=2000.0), cost=cost)

    assert len({m.blocks for m in found.choice().members if m.blocks}) > 1
    assert len({m.blocks for m in at_limit.choice.members if m.blocks}) == 1


def test_discriminants_on_every_set_come_before_the_network_and_further_forests():
    """They take a hundredth of its time: where time runs out none of them may be missing."""
    sets = feature_sets(400, 5)
    tried = [(own.model, own.features) for own in first_round(sets, 400)]
    before = tried[: tried.index(("touchnet", ""))]

    assert {features for model, features in before if "discriminant" in model} == set(sets) - {
        KERNELS
    }
    assert [model for model, _ in before if "trees" in model or "forest" in model] == [
        "extra-trees"
    ]


@pytest.mark.slow
def test_models_on_kernels_share_features_that_are_saved_with_them(base: Base, tmp_path: Path):
    (prepared, *_) = prepare_all(base)
    members = tuple(
        Member(candidate=Candidate(family, model, KERNELS, strength), blocks=(KERNELS,),
               weight=0.5, sharpness=1.0)
        for family, model, strength in (
            ("trees", "extra-trees", 2), ("discriminant", "winsorised-discriminant", 0.3),
        )
    )  # fmt: skip
    found = search(base, list(range(12)), 60.0).choice()
    choice = replace(found, members=members, window=prepared.config)
    write_choice(tmp_path / "expert.json", choice)
    blend = fit_choice(read_choice(tmp_path / "expert.json"), base, prepared, list(range(12)))
    loaded = Blend()
    loaded.load_state_dict(blend.state_dict())
    values = torch.from_numpy(prepared.dataset.windows.values)
    mask = torch.from_numpy(prepared.dataset.windows.mask)

    assert len(blend.features) == 1
    assert isinstance(blend.features[0], KernelFeatures)
    with torch.inference_mode():
        whole = blend(values, mask)
        assert torch.equal(whole, loaded.eval()(values, mask))
    tested = np.isin(prepared.trial, range(12, 16))
    y = base.y[prepared.trial[tested]]
    assert (whole[torch.from_numpy(tested)].argmax(dim=1).numpy() == y).mean() > 0.9


def test_kernels_are_tried_on_windows_that_are_long_enough_and_are_a_kind_of_their_own():
    assert KERNELS not in feature_sets(8, 4)
    own = [tried for tried in first_round(feature_sets(9, 4), 9) if tried.features == KERNELS]

    assert {tried.kind for tried in own} == {"trees of kernels", "discriminant of kernels"}
    assert {tried.camp for tried in own} == {KERNELS}
