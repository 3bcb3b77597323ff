"""Every kind of leak is found where it is planted, on both systems, and nowhere else."""

from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.bench.audit.plants import PLANTS, Plant
from taxel.evaluation.audit.audit import audit
from taxel.evaluation.audit.finding import Audit
from taxel.evaluation.audit.sides import named_sides
from taxel.evaluation.audit.touch_set import TouchSet, usual_steps

KNOWN_OTHERWISE = {
    "augmented copies", "duplicates", "near-duplicates", "same session", "same object",
}  # fmt: skip
"""Leaks that are seen from the recordings themselves: of few copies the label need not follow."""


def alarms(result: Audit) -> set[str]:
    """Return the kinds of all alarms."""
    return {alarm.kind for alarm in result.alarms}


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.make.__name__.strip("_"))
def test_a_planted_leak_is_found_with_its_accuracy(
    plant: Plant, system: TouchSet, tmp_path: Path
) -> None:
    """Each kind is an alarm that says what it alone gives beside the majority, and what to do."""
    if plant.arrays_only and system.kind != "array":
        pytest.skip("a camera's run stores no scaling of its images")
    spoilt, split, run = plant.make(system, tmp_path)

    result = audit(spoilt, "planted", split, run=run)

    assert set(plant.kinds) <= alarms(result)
    for finding in result.findings:
        if finding.kind in plant.kinds:
            assert finding.alone is not None
            assert finding.majority is not None
            if finding.kind not in KNOWN_OTHERWISE:
                assert finding.alone > finding.majority
            assert finding.mend


def test_at_least_twelve_kinds_are_planted() -> None:
    """The plants name at least twelve different kinds of leak."""
    assert len({kind for plant in PLANTS for kind in plant.kinds}) >= 12


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("kind", "key"), [("array", "session"), ("camera", "cup")])
def test_a_clean_split_raises_no_alarm(
    make_set: dict[str, Callable[..., TouchSet]], kind: str, key: str, seed: int
) -> None:
    """Whole sessions or cups held out of clean recordings: nothing but notes, whatever the seed."""
    touch = make_set[kind](seed)

    result = audit(touch, "clean", named_sides(touch, f"group:{key}", usual_steps(touch), 5, 0))

    assert not result.alarms
    assert result.verdict.startswith("No leak found")


def test_clean_recordings_by_themselves_hold_no_leak(system: TouchSet) -> None:
    """Without a split, clean recordings may wait for a careless one, but they leak nothing."""
    result = audit(system, "clean")

    assert not [finding for finding in result.findings if finding.verdict == "leak"]
    assert not {"length", "place", "first frame", "order", "duplicates"} & alarms(result)


def test_an_audit_is_the_same_twice(make_set: dict[str, Callable[..., TouchSet]]) -> None:
    """Seeds make every figure repeat."""
    assert audit(make_set["array"](), "x") == audit(make_set["array"](), "x")


@pytest.mark.parametrize(("trials", "suspected"), [(48, False), (400, True)])
def test_a_first_row_ahead_by_few_trials_is_no_leak(
    make_set: dict[str, Callable[..., TouchSet]],
    monkeypatch: pytest.MonkeyPatch,
    trials: int,
    suspected: bool,
) -> None:
    """Of 48 trials, 0.79 against 0.69 are five; of 400 they are forty."""
    from taxel.evaluation.audit import nuisances
    from taxel.evaluation.audit.audit import make_case
    from taxel.evaluation.audit.evidence import LabelEvidence

    first, middle = (
        LabelEvidence(accuracy=accuracy, majority=0.5, auc=None, p=0.0) for accuracy in (0.79, 0.69)
    )
    monkeypatch.setattr(nuisances, "_first_evidence", lambda case: first)
    monkeypatch.setattr(nuisances, "trial_evidence", lambda case, features: middle)
    case = make_case(make_set["array"](0, trials=trials), None, 10, 0)
    message = nuisances.read_first(case).finding(0.0).message
    assert ("better than the middle one" in message) == suspected


def test_labels_at_random_raise_no_alarm(make_set: dict[str, Callable[..., TouchSet]]) -> None:
    """Of ten small sets whose first rows are noise, none has its first row suspected."""
    from taxel.evaluation.audit.audit import make_case
    from taxel.evaluation.audit.nuisances import read_first

    for seed in range(10):
        touch = make_set["array"](seed, trials=30)
        case = make_case(touch, None, 10, seed)
        reading = read_first(case)
        assert not reading.finding(reading.evidence.p).alarm
