"""The API reference: a page for each public module, made from its docstrings by mkdocstrings.

A package's page lists what stands in it. Knows nothing about how docstrings are drawn.
"""

from __future__ import annotations

import ast
from pathlib import Path

from website.places import API, ROOT, modules


def api_pages() -> dict[str, str]:
    """Return page → Markdown, for every public module and package."""
    every = list(modules())
    packages = {parts[:-1] for parts in every if len(parts) > 1}
    pages = {f"{API}/index.md": _start(every)}
    for parts in every:
        name = ".".join(parts)
        inside = [other for other in every if other[:-1] == parts]
        if parts in packages:
            pages[f"{API}/{'/'.join(parts)}/index.md"] = _package(name, inside, packages)
        else:
            pages[f"{API}/{'/'.join(parts)}.md"] = _titled(name)
    return pages


def _titled(name: str) -> str:
    """Return the page of one module; the navigation shows the last part of its name."""
    return f"---\ntitle: {name.rpartition('.')[2]}\n---\n\n::: {name}\n"


def _start(every: list[tuple[str, ...]]) -> str:
    """Return the page that leads into the reference."""
    lines = [
        "# Python names",
        "",
        "Every public module, made from its docstrings. Which stage may import which: "
        "[where things go](../../where-things-go.md).",
        "",
        "| module | what it does |",
        "|---|---|",
    ]
    for parts in every:
        if len(parts) == 2:
            inside = any(other[:2] == parts and len(other) == 3 for other in every)
            target = f"taxel/{parts[1]}/index.md" if inside else f"taxel/{parts[1]}.md"
            lines.append(f"| [`{'.'.join(parts)}`]({target}) | {_first_line(parts)} |")
    return "\n".join(lines) + "\n"


def _package(name: str, inside: list[tuple[str, ...]], packages: set[tuple[str, ...]]) -> str:
    lines = [_titled(name), "| module | what it does |", "|---|---|"]
    for parts in inside:
        target = f"{parts[-1]}/index.md" if parts in packages else f"{parts[-1]}.md"
        lines.append(f"| [`{parts[-1]}`]({target}) | {_first_line(parts)} |")
    return "\n".join(lines) + "\n"


def _first_line(parts: tuple[str, ...]) -> str:
    """Return the first sentence of a module's docstring."""
    path = ROOT / "src" / "/".join(parts)
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split()).replace("|", "\\|")


def constants_table(name: str) -> str:
    """Return a module's public constants as a table of name, value, and the words beside them.

    Args:
        name: Such as `taxel.sim.teng.constants`.
    """
    path = (ROOT / "src" / Path(*name.split("."))).with_suffix(".py")
    body = ast.parse(path.read_text("utf-8")).body
    lines = ["| constant | value | meaning and source |", "|---|---|---|"]
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            words = _docstring(after)
            value = ast.unparse(node.value).replace("|", "\\|")
            lines.append(f"| `{node.targets[0].id}` | `{value}` | {words} |")
    return "\n".join(lines)


def _docstring(node: ast.stmt | None) -> str:
    """Return the string that stands below a constant, on one line; "" where none does."""
    match node:
        case ast.Expr(value=ast.Constant(value=str(text))):
            return " ".join(text.split()).replace("|", "\\|")
    return ""
