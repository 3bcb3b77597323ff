"""Refuse a built site that lacks a public name or fetches something: `make docs`.

The names are read from the source text, not from what built the pages. Knows nothing about
MkDocs.
"""

from __future__ import annotations

import ast
import re
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

from website.places import ROOT, modules

_FETCHED = re.compile(
    r"<(?:script|img|iframe|source)\b[^>]*\bsrc=[\"']?(?:https?:)?//[^\"'> ]+"
    r"|<link\b(?=[^>]*\brel=[\"']?(?:stylesheet|preconnect|preload))"
    r"[^>]*\bhref=[\"']?(?:https?:)?//[^\"'> ]+"
)
"""A tag that makes the browser fetch from elsewhere."""


def public_names() -> Iterator[str]:
    """Yield each public name of taxel: modules, functions, classes, methods, constants."""
    for parts in modules():
        path = ROOT / "src" / Path(*parts)
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        name = ".".join(parts)
        yield name
        yield from defined_names(path.read_text("utf-8"), name)


def defined_names(text: str, inside: str) -> Iterator[str]:
    """Yield the public names that a module's text defines.

    Args:
        text: Python.
        inside: The module's own name.
    """
    yield from _defined(ast.parse(text).body, inside)


def _defined(body: list[ast.stmt], inside: str) -> Iterator[str]:
    for node in body:
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                names = [name]
            case ast.ClassDef(name=name):
                names = [name]
                if not name.startswith("_"):
                    yield from _defined(node.body, f"{inside}.{name}")
            case ast.AnnAssign(target=ast.Name(id=name)):
                names = [name]
            case ast.Assign(targets=targets):
                names = [each.id for each in targets if isinstance(each, ast.Name)]
            case _:
                names = []
        yield from (f"{inside}.{name}" for name in names if not name.startswith("_"))


def listed_names(site: Path) -> set[str]:
    """Return the names that the site's API reference has a place for.

    Args:
        site: The built site, whose `objects.inv` is Sphinx's inventory, version 2.
    """
    packed = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    return {line.split(" ")[0] for line in zlib.decompress(packed).decode().splitlines()}


def fetched(site: Path) -> list[str]:
    """Return the tags that would make a browser fetch something from elsewhere."""
    found = []
    for page in sorted(site.rglob("*.html")):
        text = page.read_text("utf-8")
        found += [f"{page.relative_to(site)}: {tag}" for tag in _FETCHED.findall(text)]
    return found


def main() -> None:
    """Print what is wrong; exit code 1 where something is."""
    site = Path(sys.argv[1])
    names = set(public_names())
    wrong = [f"not in the API reference: {name}" for name in sorted(names - listed_names(site))]
    wrong += [f"fetched from elsewhere: {tag}" for tag in fetched(site)]
    for line in wrong:
        print(line)
    pages = sum(1 for _ in site.rglob("*.html"))
    print(f"{site}: {pages} pages, {len(names)} public names, {len(wrong)} problems")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
