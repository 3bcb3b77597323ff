"""A planted leak is found only where the clean recordings did not raise the same alarm."""

from collections.abc import Sequence
from types import SimpleNamespace

import pytest

from taxel.bench.audit import leaks as audit_leaks
from taxel.bench.audit.leaks import new_alarms, planted_leaks
from taxel.bench.audit.plants import Plant
from taxel.evaluation.audit.finding import Audit, Finding, Verdict

CLEAN, SPLIT, SPOILT = "clean", "clean and split", "spoilt"
Verdicts = dict[str, Verdict]


def audited(verdicts: Verdicts) -> Audit:
    """Return an audit of these findings."""
    findings = [
        Finding(kind=kind, verdict=verdict, message="") for kind, verdict in verdicts.items()
    ]
    return Audit(data="", kind="array", target="", classes={}, split="", read_on="",
                 findings=tuple(findings))  # fmt: skip


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        ("clear", "leak", True),
        ("note", "hazard", True),
        ("not checked", "hazard", True),
        ("hazard", "leak", True),
        ("hazard", "hazard", False),
        ("leak", "leak", False),
        ("leak", "hazard", False),
        ("clear", "note", False),
    ],
)
def test_an_alarm_counts_only_where_it_is_worse_than_before(
    before: Verdict, after: Verdict, found: bool
) -> None:
    spoilt = audited({"length": after})

    assert new_alarms(spoilt, [audited({"length": before})]) == ({"length"} if found else set())
    assert bool(new_alarms(spoilt, [audited({"length": before}), audited({})])) == found


def bench(monkeypatch: pytest.MonkeyPatch, verdicts: dict[str, Verdicts], kinds: Sequence[str]):  # type: ignore[no-untyped-def]
    """Run the bench on one set whose audits say these verdicts."""
    touch, spoilt = SimpleNamespace(kind="array", is_=CLEAN), SimpleNamespace(is_=SPOILT)

    def fake_audit(own, system, split, run=None):  # type: ignore[no-untyped-def]
        return audited(verdicts[SPLIT if own is touch and split else own.is_])

    plant = Plant(tuple(kinds), lambda _touch, _folder: (spoilt, None, None))  # type: ignore[arg-type,return-value]
    monkeypatch.setattr(audit_leaks, "_clean_sets", lambda _: [("pours", touch, "cup")])
    monkeypatch.setattr(audit_leaks, "named", lambda *_: "split")
    monkeypatch.setattr(audit_leaks, "audit", fake_audit)
    monkeypatch.setattr(audit_leaks, "PLANTS", (plant,))
    return planted_leaks()


def test_what_the_clean_recordings_raised_too_is_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    leaks, alarms = bench(
        monkeypatch,
        {
            CLEAN: {"order": "hazard", "level": "clear", "trial": "hazard"},
            SPLIT: {"order": "clear", "level": "clear", "trial": "clear"},
            SPOILT: {"order": "hazard", "level": "leak", "trial": "leak"},
        },
        ["order", "level", "trial"],
    )

    assert leaks.value == 2
    assert not leaks.ok
    assert "not found: pours: order" in leaks.note
    assert alarms.value == 0
    assert "hazards by themselves, not counted: pours: order, pours: trial" in alarms.note


def test_clean_recordings_without_hazards_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    leaks, alarms = bench(
        monkeypatch,
        {CLEAN: {"order": "clear"}, SPLIT: {"order": "leak"}, SPOILT: {"order": "leak"}},
        ["order"],
    )

    assert leaks.value == 0, "the clean split raised it too"
    assert alarms.value == 1
    assert alarms.note.endswith("not counted: none")
