"""The audit in the terminal: a stranger sees which figure counts by a rule and which by a test."""

from rich.console import Console

from taxel.evaluation.audit.finding import Audit, Finding
from taxel.views.tables.audit import audit_table, chance

FINDINGS = (
    Finding(kind="same session", verdict="leak", message="On both.", alone=0.36, majority=0.38),
    Finding(kind="length", verdict="leak", message="It tells.", alone=0.9, majority=0.4, p=0.0002),
    Finding(kind="level", verdict="note", message="It may.", alone=0.5, majority=0.4, p=0.0042),
)
AUDIT = Audit(data="d", kind="array", target="shape", classes={"a": 4, "b": 4}, split="by windows",
              read_on="session held out", findings=FINDINGS)  # fmt: skip


def test_each_figure_says_by_what_it_counts():
    console = Console(width=80, record=True)
    console.print(audit_table(AUDIT))
    printed = console.export_text()

    assert [chance(finding) for finding in FINDINGS] == ["rule", "< 0.001", "0.004"]
    assert chance(Finding(kind="trial", verdict="clear", message="None.")) == "–"
    for column in ("accuracy", "majority", "AUC", "p"):
        assert f"{column}: " in printed
    assert "session held out, since the split divides" in printed
    assert max(map(len, printed.splitlines())) <= 80
