"""What MkDocs calls while it builds the site: pages that are made, the navigation, the links.

Knows nothing about what stands on a page.
"""

from __future__ import annotations

import posixpath
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parents[1]))

from website.api_pages import api_pages, constants_table
from website.cli_pages import cli_pages
from website.places import ROOT, TAKEN, turn_links
from website.sections import SECTIONS, by_job, listing, order_of, written

_TOP = {"taxel": "index.md", "Tutorial": "tutorial.md", "Gallery": "gallery.md"}
"""Name in the bar at the top → page; other pages of docs/ itself stand under Project."""
_CITED = re.compile(r"docs/(decisions/\d{4}|explanation/[\w-]+)(?!\.?[\w/-])")
"""How a docstring names a decision, or a page that explains."""
_CONSTANTS = re.compile(r"<!-- constants: ([\w.]+) -->")
"""Stands for a table of a module's constants."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Make the navigation from the folders, so that a new page needs no entry."""
    _MADE.clear()
    _MADE.update(_made_pages())
    pages = _titles()
    sections = {name: _tree(folder, pages) for folder, name in SECTIONS.items()}
    sections["How to"] = by_job(sections["How to"])
    rest = {page for page in pages if "/" not in page} - set(_TOP.values())
    sections["Project"] += sorted(rest)
    top = [{name: page} for name, page in _TOP.items()]
    config["nav"] = top + [{name: tree} for name, tree in sections.items()]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that stand elsewhere or are made here."""
    for page, text in _MADE.items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn a written page's links, and fill in its tables; made pages are right already."""
    place = page.file.src_uri
    if place in _MADE:
        return markdown
    markdown = _CONSTANTS.sub(lambda match: constants_table(match[1]), markdown)
    return turn_links(markdown, f"docs/{place}", place)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Link decisions and explanations that a docstring cites."""
    here = posixpath.dirname(page.file.src_uri) or "."
    cited = {path.removesuffix(".md"): path for path in written()}
    cited |= {path[: len("decisions/0000")]: path for path in cited.values()}

    def linked(match: re.Match[str]) -> str:
        there = cited.get(match[1])
        if there is None:
            return match[0]
        folder, _, name = match[1].partition("/")
        words = f"decision {int(name)}" if folder == "decisions" else name.replace("-", " ")
        target = posixpath.relpath(there.removesuffix(".md") + ".html", here)
        return f'<a href="{target}">{words}</a>'

    return _CITED.sub(linked, html)


_MADE: dict[str, str] = {}
"""Page of the site → its Markdown, for all that is not a file of docs/."""


def _made_pages() -> dict[str, str]:
    made = {}
    for source, page in TAKEN.items():
        text = (ROOT / source).read_text("utf-8")
        if not source.endswith(".md"):
            text = f"# {source.capitalize()}\n\n```text\n{text}```\n"
        made[page] = turn_links(text, source, page)
    for path in sorted((ROOT / "examples").glob("[0-9]*.py")):
        text = path.read_text("utf-8")
        lead = text.split('"""')[1].strip()
        made[f"examples/{path.stem}.md"] = f"# {path.stem}\n\n{lead}\n\n```python\n{text}```\n"
    made |= api_pages() | cli_pages()
    for folder, name in SECTIONS.items():
        made[f"{folder}/index.md"] = listing(folder, name, made)
    return made


def _titles() -> set[str]:
    return set(written()) | set(_MADE)


def _tree(folder: str, pages: set[str]) -> list[Any]:
    """Return a folder's pages as MkDocs wants them: its index first, then the rest by name."""
    inside = sorted((page for page in pages if page.startswith(f"{folder}/")), key=order_of)
    own = [page for page in inside if posixpath.dirname(page) == folder]
    deeper = {page[len(folder) + 1 :].split("/")[0] for page in inside} - {
        posixpath.basename(page) for page in own
    }
    tree: list[Any] = list(own)
    for name in sorted(deeper):
        place = f"{folder}/{name}"
        tree.append({_NAMES.get(place, name): _tree(place, pages)})
    return tree


_NAMES = {
    "reference/cli": "The command taxel",
    "reference/api": "Python names",
    "decisions/evidence": "Evidence",
}
"""Folder of the site → what the navigation calls it, where that is not its own name."""
