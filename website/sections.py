"""The site's sections: which pages each has, in which order, and a page that lists them.

Knows nothing about MkDocs, so that tests need none.
"""

from __future__ import annotations

import posixpath
from typing import Any

from website.places import ROOT, title_and_lead

SECTIONS = {
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
LEADS = {
    "how-to": "One task per page. New here? Begin with the first group.",
    "explanation": "Why things are as they are, and the physics behind the simulators.",
    "reference": "Commands, Python names, formats, figures.",
    "examples": "Short programs that run by themselves; CI runs all of them.",
    "decisions": "Each choice that a reader may question, with what was measured. "
                 "Code cites these pages by number.",
    "project": "How taxel is built, and what changed.",
}  # fmt: skip


def listing(folder: str, name: str, made: dict[str, str]) -> str:
    """Return a section's page: each of its pages with its first sentence, how-tos by job."""
    rows = {}
    texts = written() | made
    for page in sorted(texts, key=order_of):
        place, _, leaf = page.rpartition("/")
        deeper = leaf == "index.md" and posixpath.dirname(place) == folder
        if deeper or (place == folder and leaf != "index.md"):
            title, lead = title_and_lead(texts[page])
            title = title or leaf
            rows[page] = f"| [{title}]({posixpath.relpath(page, folder)}) | {lead} |"
    lines = [f"# {name}", "", LEADS[folder], ""]
    groups = by_job(list(rows)) if folder == "how-to" else list(rows)
    above = [rows[group] for group in groups if isinstance(group, str)]
    head = ["| page | what it says |", "|---|---|"]
    if above:
        lines += [*head, *above, ""]
    for group in groups:
        for job, pages in group.items() if isinstance(group, dict) else ():
            lines += [f"## {job}", "", *head, *(rows[page] for page in pages), ""]
    return "\n".join(lines)


def written() -> dict[str, str]:
    """Return the pages of docs/ with their text."""
    docs = ROOT / "docs"
    return {
        path.relative_to(docs).as_posix(): path.read_text("utf-8") for path in docs.rglob("*.md")
    }


def by_job(tree: list[Any]) -> list[Any]:
    """Return the pages of how-to/ under the headings of `JOBS`."""
    jobs = {job: [f"how-to/{name}.md" for name in names] for job, names in JOBS.items()}
    placed = {page for pages in jobs.values() for page in pages}
    return [page for page in tree if page not in placed] + [{job: jobs[job]} for job in jobs]


def order_of(page: str) -> tuple[bool, str]:
    """Return what pages are sorted by: the folder's own page first, then names."""
    return (not page.endswith("index.md"), page)
