"""What a public docstring says of arguments and errors is so; a line alone need not name them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src/taxel"
SECTION = re.compile(r"^(Args|Returns|Yields|Raises|Source):", re.M)
ENTRY = re.compile(r"^    (\*{0,2}[a-z_]\w*(?:, \*{0,2}[a-z_]\w*)*):(?: |$)", re.M)
Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions(node: ast.Module | ast.ClassDef, path: str) -> Iterator[tuple[str, Function, str]]:
    """Yield place, node and docstring of each public function and method."""
    for child in node.body:
        name = getattr(child, "name", "_")
        if isinstance(child, ast.ClassDef) and not name.startswith("_"):
            yield from functions(child, f"{path}:{name}")
        elif isinstance(child, Function) and not name.startswith("_"):
            yield f"{path}:{name}", child, ast.get_docstring(child) or ""


@cache
def every_function() -> list[tuple[str, Function, str]]:
    """Return those whose docstring has sections; a module without any is not parsed."""
    found: list[tuple[str, Function, str]] = []
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text("utf-8")
        if re.search(r"^ +(Args|Raises):$", text, re.M):
            found += functions(ast.parse(text), str(path.relative_to(SOURCE)))
    return [(place, node, text) for place, node, text in found if SECTION.search(text)]


def section(docstring: str, name: str) -> str:
    """Return the lines of one section, empty where there is none."""
    found = re.search(rf"^{name}:\n(.*?)(?=^\S|\Z)", docstring, re.M | re.S)
    return found.group(1) if found else ""


def raised_in(node: ast.AST) -> Iterator[str]:
    """Yield the errors that stand behind `raise` and are not caught again around it."""
    if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
        yield ast.unparse(node.exc.func)
    caught: set[str] = set()
    if isinstance(node, ast.Try):
        caught = {name.id for handler in node.handlers if handler.type is not None
                  for name in ast.walk(handler.type) if isinstance(name, ast.Name)}  # fmt: skip
    for field, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not isinstance(child, Function | ast.ClassDef):
                found = raised_in(child)
                yield from (name for name in found if field != "body" or name not in caught)


@pytest.mark.slow
def test_a_docstring_with_sections_names_each_error_that_its_function_raises() -> None:
    silent = {
        place: unnamed
        for place, node, docstring in every_function()
        if (unnamed := {
            name for name in raised_in(node)
            if name[0].isupper() and name != "SystemExit" and name not in docstring
        })
    }  # fmt: skip

    assert silent == {}


@pytest.mark.slow
def test_a_section_of_arguments_names_all_of_them_and_no_others() -> None:
    wrong = {}
    for place, node, docstring in every_function():
        entries = ENTRY.findall(section(docstring, "Args"))
        named = {name.strip(" *") for entry in entries for name in entry.split(",")}
        arguments = node.args
        plain = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
        given = {argument.arg for argument in plain} - {"self", "cls"}
        starred = {argument.arg for argument in (arguments.vararg, arguments.kwarg) if argument}
        if named and not given <= named <= given | starred:
            wrong[place] = named ^ given

    assert wrong == {}


def test_errors_are_found_where_they_leave_a_function() -> None:
    """What is caught around it is not raised; what a handler raises is."""
    source = """
def opened():
    try:
        raise BadFile("a")
    except BadFile as error:
        raise BadInput("b") from error
    finally:
        raise ValueError("c")
"""
    assert set(raised_in(ast.parse(source).body[0])) == {"BadInput", "ValueError"}
