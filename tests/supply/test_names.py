"""Names say what a thing is (CONTRIBUTING.md, "Language")."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLACES = ("src", "tests", "examples", "supply", "website", "mutants")
NUMERALS = {"one", "two", "three"}
DIALECT = {
    "tell", "tells", "told", "telling", "teller", "crew", "minds", "wish", "wishes", "strange",
    "strangeness", "said", "unsaid",
}  # fmt: skip
PUBLISHED = {
    "cli/live/live.py": {"tell"}, "cli/live/station.py": {"tell"},
    "calibration/baseline.py": {"told_rms_v"},
}  # fmt: skip
"""Module → names that users type or that stored files hold, so that they stay."""


def bound(text: str) -> dict[int, set[str]]:
    """Return the names that each statement, loop, list of parameters or pattern binds, by line."""
    found: dict[int, set[str]] = {}
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.arguments():
                names = {arg.arg for arg in ast.walk(node) if isinstance(arg, ast.arg)}
            case ast.For(target=target) | ast.comprehension(target=target):
                names = stored(target)
            case ast.Assign(targets=targets):
                names = {name for target in targets for name in stored(target)}
            case ast.AnnAssign(target=target) | ast.NamedExpr(target=target):
                names = stored(target)
            case ast.withitem(optional_vars=ast.AST() as target):
                names = stored(target)
            case ast.MatchAs(name=str(name)) | ast.ExceptHandler(name=str(name)):
                names = {name}
            case _:
                continue
        line = next((n.lineno for n in ast.walk(node) if hasattr(n, "lineno")), 0)
        found.setdefault(line, set()).update(names)
    return found


def stored(target: ast.AST) -> set[str]:
    return {node.id for node in ast.walk(target) if isinstance(node, ast.Name)}


def nameless(text: str) -> list[int]:
    """Return the lines that call a thing `one` where it is no numeral beside `two`."""
    if not re.search(r"\bone\b", text):
        return []
    return [line for line, names in bound(text).items() if names & NUMERALS == {"one"}]


@pytest.mark.parametrize("text", [
    "for one in rows: pass", "[one for one in rows]", "key = lambda one: one.name", "one = rows[0]",
    "def f(one: Row): pass", "with open(path) as one: pass", "(one := 3)", "(one,) = rows",
    "match row:\n    case int() as one: pass", "{k: one for k, one in rows.items()}",
])  # fmt: skip
def test_a_thing_called_one_is_found(text: str):
    assert nameless(text)


@pytest.mark.parametrize("text", [
    "one, two = pair", "for kind, one, two in events: pass", "none = 'one'  # one in ten",
])  # fmt: skip
def test_numerals_beside_each_other_may_stay(text: str):
    assert not nameless(text)


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
def test_no_thing_is_called_one(place: str):
    found = {
        f"{path.relative_to(ROOT)}:{line}"
        for path in sorted((ROOT / place).rglob("*.py"))
        for line in nameless(path.read_text("utf-8"))
    }
    assert not found


def defined(text: str) -> set[str]:
    """Return every name that a module defines: as above, functions, classes and attributes."""
    if not re.search("|".join(DIALECT), text, re.IGNORECASE):
        return set()
    found = {name for names in bound(text).values() for name in names}
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                found |= set() if name.startswith("test_") else {name}  # a claim, in plain English
            case ast.ClassDef(name=name) | ast.Attribute(attr=name, ctx=ast.Store()):
                found.add(name)
    return found


def in_dialect(names: set[str]) -> set[str]:
    """Return the names of which a part is refused: our own dialect, or a word for no thing."""
    return {
        name
        for name in names
        if DIALECT & {part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)}
    }


@pytest.mark.parametrize("text", [
    "told = 1", "self._told_s = 0.0", "def tell_state(): pass", "class CrewWatch: pass",
    "_TELL_S = 1", "def f(wishes): pass", "for minds in x: pass", "said: str",
    "def _shown_said(): pass", "self._said_s = 0.0",
])  # fmt: skip
def test_a_word_of_dialect_is_found_in_any_defined_name(text: str):
    assert in_dialect(defined(text))


@pytest.mark.parametrize("text", [
    "place = file.tell()", "reminds = retold = 1", "study.tell(trial, state=1)",
    "def test_two_are_told_apart(): pass",
])  # fmt: skip
def test_others_names_and_whole_other_words_may_stay(text: str):
    assert not in_dialect(defined(text))


@pytest.mark.parametrize("place", PLACES)
def test_no_name_is_in_dialect(place: str):
    found = {}
    for path in sorted((ROOT / place).rglob("*.py")):
        own = path.relative_to(ROOT / place).as_posix().removeprefix("taxel/")
        names = defined(path.read_text("utf-8")) | {path.stem}
        if left := in_dialect(names) - PUBLISHED.get(own, set()):
            found[own] = left
    assert not found


def test_each_published_name_is_still_there():
    for module, names in PUBLISHED.items():
        assert names <= defined((ROOT / "src/taxel" / module).read_text("utf-8"))
