"""Claims about the table of reasons: complete, unambiguous, and what the docs say."""

import ast
import re
import runpy
import warnings
from pathlib import Path

import pytest

import taxel
from taxel.decisions.reasons import REASONS, SIMULATED, in_words, kind_of, reference

ROOT = Path(taxel.__file__).parent
FIELDS = {
    "camera": "left", "who": "monitor/0", "why": "needed images of 320 × 240 px; got one of 2 × 2",
    "left_s": 0.6, "silent_ms": 83.0, "silent_s": 0.07, "age_s": 0.25, "same_s": 1.2,
}  # fmt: skip


def test_words_lead_back_to_their_reason() -> None:
    for name, reason in REASONS.items():
        assert kind_of(reason.say(**FIELDS)) == name
        assert kind_of(SIMULATED + reason.say(**FIELDS)) == name
    assert kind_of("") is None
    assert kind_of("because") is None


@pytest.mark.parametrize(("who", "words"), [
    ("monitor/0", "the monitor"),
    ("monitor/2", "bundle 3 of the monitor"),
    ("monitor 2/0", "the monitor of source 2"),
    ("monitor 2/1", "bundle 2 of the monitor of source 2"),
])  # fmt: skip
def test_a_monitor_is_named_as_an_operator_knows_it(who: str, words: str) -> None:
    assert in_words(who) == words


def test_the_page_of_reference_is_that_of_the_table() -> None:
    page = ROOT.parents[1] / "docs" / "reference" / "unknown.md"

    assert page.read_text(encoding="utf-8") == reference()


def test_the_command_that_the_page_names_writes_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert "`python -m taxel.decisions.reasons >" in reference()
    with warnings.catch_warnings(action="ignore"):  # it is imported already
        runpy.run_module("taxel.decisions.reasons", run_name="__main__")
    assert capsys.readouterr().out == reference()


def test_no_unknown_decision_is_made_with_words_of_its_own() -> None:
    """In live, decisions and actions a reason is never written where a decision is made."""
    for path in [*ROOT.glob("live/**/*.py"), *ROOT.glob("decisions/stab*.py")]:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(
                ("StabilityDecision", "._decide", "._send", ".doubt")
            ):
                own = [
                    arg
                    for arg in node.args
                    if isinstance(arg, ast.JoinedStr)
                    or (isinstance(arg, ast.Constant) and isinstance(arg.value, str) and arg.value)
                ]
                assert not own, f"{path}:{node.lineno}"


def test_the_page_in_the_browser_uses_words_of_the_table() -> None:
    script = (ROOT / "views" / "page" / "static" / "state.js").read_text(encoding="utf-8")
    given = re.findall(r'word: "UNKNOWN", reason: "([^"]+)"', script)

    assert given
    assert all(kind_of(words) for words in given)
