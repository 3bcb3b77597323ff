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
from website.places import ROOT, TAKEN, title_and_lead, turn_links

_TOP = {"taxel": "index.md", "Tutorial": "tutorial.md", "Gallery": "gallery.md"}
"""Name in the bar at the top → page; other pages of docs/ itself stand under Project."""
_SECTIONS = {
    "how-to": "How to",
    "explanation": "Explanation",
    "reference": "Reference",
    "examples": "Examples",
    "decisions": "Decisions",
    "project": "Project",
}
"""Folder of the site → its heading, in this order."""
JOBS = {
    "Your own recordings": (
        "own-array", "long-recordings", "camera-trials", "tactile-cameras", "real-recordings",
    ),
    "Connect and record": (
        "serial-boards", "cameras-live", "scene-camera", "collect", "calibrate", "pads",
        "build-the-kit", "firmware", "flash",
    ),
    "Train and evaluate": (
        "audit", "others-split", "tune", "training-curves", "robustness", "unknown-objects",
        "adapt", "weights", "many-workers", "report",
    ),
    "Run live": (
        "live-station", "operators-page", "slip-warning", "person-in-the-loop", "gripper-and-arm",
        "cnn-on-the-board",
    ),
    "Beside other programs": ("live-bus", "fleet", "foxglove-and-ros", "lerobot"),
}  # fmt: skip
"""Heading → pages of how-to/, in this order, in the navigation and on the section's own page; other
pages stand above them."""
_LEADS = {
    "how-to": "One task per page. New here? Begin with the first group.",
    "explanation": "Why things are as they are, and the physics behind the simulators.",
    "reference": "Commands, Python names, formats, figures.",
    "examples": "Short programs that run by themselves; CI runs all of them.",
    "decisions": "Each choice that a reader may question, with what was measured. "
                 "Code cites these pages by number.",
    "project": "How taxel is built, and what changed.",
}  # fmt: skip
_CITED = re.compile(r"docs/(decisions/\d{4}|explanation/[\w-]+)(?!\.?[\w/-])")
"""How a docstring names a decision, or a page that explains."""
_CONSTANTS = re.compile(r"<!-- constants: ([\w.]+) -->")
"""Stands for a table of a module's constants."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Make the navigation from the folders, so that a new page needs no entry."""
    _MADE.clear()
    _MADE.update(_made_pages())
    pages = _titles()
    sections = {name: _tree(folder, pages) for folder, name in _SECTIONS.items()}
    sections["How to"] = _by_job(sections["How to"])
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
    cited = {path.removesuffix(".md"): path for path in _written()}
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
    for folder, name in _SECTIONS.items():
        made[f"{folder}/index.md"] = listing(folder, name, made)
    return made


def listing(folder: str, name: str, made: dict[str, str]) -> str:
    """Return a section's page: each of its pages with its first sentence, how-tos by job."""
    rows = {}
    texts = _written() | made
    for page in sorted(texts, key=_order):
        place, _, leaf = page.rpartition("/")
        deeper = leaf == "index.md" and posixpath.dirname(place) == folder
        if deeper or (place == folder and leaf != "index.md"):
            title, lead = title_and_lead(texts[page])
            title = title or leaf
            rows[page] = f"| [{title}]({posixpath.relpath(page, folder)}) | {lead} |"
    lines = [f"# {name}", "", _LEADS[folder], ""]
    groups = _by_job(list(rows)) if folder == "how-to" else list(rows)
    above = [rows[group] for group in groups if isinstance(group, str)]
    head = ["| page | what it says |", "|---|---|"]
    if above:
        lines += [*head, *above, ""]
    for group in groups:
        for job, pages in group.items() if isinstance(group, dict) else ():
            lines += [f"## {job}", "", *head, *(rows[page] for page in pages), ""]
    return "\n".join(lines)


def _written() -> dict[str, str]:
    """Return the pages of docs/ with their text."""
    docs = ROOT / "docs"
    return {
        path.relative_to(docs).as_posix(): path.read_text("utf-8") for path in docs.rglob("*.md")
    }


def _titles() -> set[str]:
    return set(_written()) | set(_MADE)


def _tree(folder: str, pages: set[str]) -> list[Any]:
    """Return a folder's pages as MkDocs wants them: its index first, then the rest by name."""
    inside = sorted((page for page in pages if page.startswith(f"{folder}/")), key=_order)
    own = [page for page in inside if posixpath.dirname(page) == folder]
    deeper = {page[len(folder) + 1 :].split("/")[0] for page in inside} - {
        posixpath.basename(page) for page in own
    }
    tree: list[Any] = list(own)
    for name in sorted(deeper):
        place = f"{folder}/{name}"
        tree.append({_NAMES.get(place, name): _tree(place, pages)})
    return tree


def _by_job(tree: list[Any]) -> list[Any]:
    """Return the pages of how-to/ under the headings of `JOBS`."""
    jobs = {job: [f"how-to/{name}.md" for name in names] for job, names in JOBS.items()}
    placed = {page for pages in jobs.values() for page in pages}
    return [page for page in tree if page not in placed] + [{job: jobs[job]} for job in jobs]


_NAMES = {
    "reference/cli": "The command taxel",
    "reference/api": "Python names",
    "decisions/evidence": "Evidence",
}
"""Folder of the site → what the navigation calls it, where that is not its own name."""


def _order(page: str) -> tuple[bool, str]:
    return (not page.endswith("index.md"), page)
