"""Where a file of the repository stands on the site, and links turned accordingly.

Pages of docs/ keep their place. Files outside of it that a reader needs (README, formats,
examples) get a place here; a module's file is its page in the API reference. Knows nothing
about MkDocs.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = "docs/"
TAKEN = {
    "README.md": "index.md",
    "CHANGELOG.md": "project/changelog.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "LICENSE": "project/licence.md",
    "firmware/README.md": "reference/firmware.md",
    "firmware/emulator/README.md": "reference/board-emulator.md",
    "protocol/SPEC.md": "reference/wire-format.md",
    "src/taxel/recordings/FORMAT.md": "reference/recording-format.md",
}
"""File of the repository → page of the site."""
FOLDERS = {
    "docs/decisions": "decisions/index.md",
    "docs/decisions/evidence": "decisions/evidence/index.md",
    "docs/explanation": "explanation/index.md",
    "docs/how-to": "how-to/index.md",
    "docs/reference": "reference/index.md",
    "examples": "examples/index.md",
}
"""Folder of the repository → the page that lists it."""
API = "reference/api"
_LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s]+)(\))")
_BLOCK = re.compile(r"^(?:```.*?^```|~~~.*?^~~~)[^\n]*", re.M | re.S)


def page_of(path: str) -> str | None:
    """Return the page of a file or folder of the repository, None where there is none.

    Args:
        path: From the repository's root, such as `docs/tutorial.md` or `src/taxel/clock.py`.
    """
    path = path.rstrip("/")
    if path in TAKEN:
        return TAKEN[path]
    if path in FOLDERS:
        return FOLDERS[path]
    if path.startswith(DOCS):
        return path.removeprefix(DOCS)
    if re.fullmatch(r"examples/[0-9].*\.py", path):
        return path.removesuffix(".py") + ".md"
    if path.startswith("src/taxel/") and path.endswith(".py"):
        return f"{API}/{path.removeprefix('src/').removesuffix('.py')}.md"
    return None


def turn_links(markdown: str, source: str, page: str) -> str:
    """Return a page's Markdown with its relative links as the site needs them.

    A link to a file that has no page stays as it is, so that a strict build refuses it.

    Args:
        markdown: The page, whose links are right in the repository.
        source: Its file in the repository.
        page: Its place on the site.
    """

    def turned(match: re.Match[str]) -> str:
        before, target, after = match.groups()
        path, mark, heading = target.partition("#")
        if not path or re.match(r"[a-z]+:", target):
            return match[0]
        there = page_of(posixpath.normpath(posixpath.join(posixpath.dirname(source), path)))
        if there is None:
            return match[0]
        return (
            before
            + posixpath.relpath(there, posixpath.dirname(page) or ".")
            + mark
            + heading
            + after
        )

    parts, end = [], 0
    for block in _BLOCK.finditer(markdown):
        parts += [_LINK.sub(turned, markdown[end : block.start()]), block[0]]
        end = block.end()
    return "".join([*parts, _LINK.sub(turned, markdown[end:])])


def title_and_lead(markdown: str) -> tuple[str, str]:
    """Return a page's heading and the first sentence below it; "" where it has none."""
    title = re.search(r"^# (.+)$", markdown, re.M)
    text = markdown[title.end() :] if title else markdown
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        if re.match(r"[A-Za-z*`\[“\"]", paragraph):
            plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(paragraph.split()))
            return (title[1] if title else "", re.split(r"(?<=\.) ", plain)[0])
    return (title[1] if title else "", "")


def modules() -> Iterator[tuple[str, ...]]:
    """Yield the public modules of taxel as parts, packages before what they hold."""
    source = ROOT / "src"
    for path in sorted(source.glob("taxel/**/*.py")):
        parts = path.relative_to(source).with_suffix("").parts
        if parts[-1] == "__init__":
            parts = parts[:-1]
        if not any(part.startswith("_") for part in parts):
            yield parts
