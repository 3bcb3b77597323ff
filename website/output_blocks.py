"""Output blocks of a page are what their commands print: `python -m website.output_blocks PAGE …`.

The commands of a page run in its order, in an empty folder. A text block right behind a shell block
is that block's output. A comment `<!-- output of: COMMAND -->` before a text block names another
command, and `<!-- not run -->` before a shell block leaves it out. In a text block "…" alone stands
for any lines, and at the end of a line for its rest. Times are masked. Figures that a training
gives may differ by a little, as processors round differently; everything else is compared exactly.
`--write` renews the blocks. Knows nothing about what the commands do.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from difflib import unified_diff
from pathlib import Path

Run = Callable[[Sequence[str], Path], list[str]]
"""Runs commands in a folder; returns what each printed, in order."""
WIDTH = 110
"""Letters of the terminal for which commands print. Our choice: what a page shows unwrapped."""
LEARNED = frozenset({"train", "evaluate", "bundle", "live", "adapt", "demo", "reproduce", "sweep"})
"""Verbs whose figures come from a training."""
SHARE, POINTS, COUNT = 0.1, 0.03, 6.0
"""How far a learned figure may be off: relative; of a share between 0 and 1; of a count. Our
choice, docs/decisions/0044."""

_PART = re.compile(
    r"^(?P<note><!-- (?:output of: (?P<named>[^\n]+?)|not run) -->)\n+(?=```)"
    r"|^```(?P<kind>\w+)\n(?P<text>.*?)^```$",
    re.M | re.S,
)
_TIME = re.compile(
    r"-?\d[\d,]*(?:\.\d+)?(?= ?(?:µs|ms|s|min|MB|MiB)\b)|(?<=127\.0\.0\.1:)\d+|\d\d:\d\d:\d\d"
)
_NUMBER = re.compile(r"-?\d[\d,]*(?:\.\d+)?(?:e-?\d+)?|(?<=[ =])\.\d+")
_RULE = re.compile(r"[─━═]{2,}|[ \t]+")


@dataclass(frozen=True, slots=True)
class Block:
    """One text block of a page and the commands that print it."""

    before: tuple[str, ...]
    """Run first; what they print is not shown."""
    shown: tuple[str, ...]
    """Whose output the block holds, one after another."""
    text: str
    start: int
    """Where the text stands in the page."""


def blocks(page: str) -> list[Block]:
    """Return a page's text blocks that show output, in order.

    Args:
        page: Markdown.
    """
    found: list[Block] = []
    waiting: list[str] = []
    shell: tuple[str, ...] = ()
    shell_end, note = -1, ""
    for part in _PART.finditer(page):
        if part["note"]:
            note = part["named"] or "not run"
            continue
        if part["kind"] == "sh":
            waiting += shell
            shell = () if note == "not run" else tuple(_commands(part["text"]))
            shell_end = part.end()
        elif part["kind"] == "text":
            behind = not page[max(shell_end, 0) : part.start()].strip()
            shown = (note,) if note else shell if behind else ()
            if shown:
                before = tuple(waiting) if shown is shell else (*waiting, *shell)
                found.append(Block(before, shown, part["text"], part.start("text")))
                waiting, shell = [], ()
        note = ""
    return found


def _commands(text: str) -> Iterator[str]:
    for line in text.replace("\\\n", " ").splitlines():
        command = line.partition(" #")[0].strip()
        if command.startswith("taxel "):
            yield command


def run(commands: Sequence[str], folder: Path) -> list[str]:
    """Run commands in a folder; return what each printed, in order.

    Args:
        commands: Lines of a shell, each with `taxel`.
        folder: Where.

    Raises:
        RuntimeError: One failed.
    """
    beside = str(Path(sys.executable).parent)
    environment = {
        **os.environ,
        "PATH": beside + os.pathsep + os.environ["PATH"],
        "COLUMNS": str(WIDTH),
        "PYTHONIOENCODING": "utf-8",
        "XDG_CACHE_HOME": str(folder / ".cache"),
    }
    printed = []
    for command in commands:
        line = re.sub(r"^taxel\b", f'"{sys.executable}" -m taxel.cli.main', command)
        done = subprocess.run(
            ["bash", "-c", line], cwd=folder, env=environment, capture_output=True, text=True,
            encoding="utf-8", check=False,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"{command}\nended with {done.returncode}: {done.stderr}")
        printed.append(plain(done.stdout))
    return printed


def plain(text: str) -> str:
    """Return what a command printed as a block shows it: no spaces at ends of lines."""
    lines = [line.rstrip() for line in text.strip("\n").splitlines()]
    return "\n".join([*lines, ""])


def matches(shown: str, printed: str, *, learned: bool = False) -> bool:
    """Return whether a block still is what its command prints.

    Args:
        shown: The block.
        printed: By the command, now.
        learned: Numbers come from a training, and may differ by a little.
    """
    return _lines_match(_lines(shown), _lines(printed), learned)


def _lines(text: str) -> list[str]:
    return [_RULE.sub(" ", _TIME.sub("#", line)).strip() for line in text.strip().splitlines()]


def _lines_match(shown: list[str], printed: list[str], learned: bool) -> bool:
    for index, line in enumerate(shown):
        if line == "…":
            rest = shown[index + 1 :]
            return any(
                _lines_match(rest, printed[at:], learned) for at in range(index, len(printed) + 1)
            )
        if index >= len(printed) or not _line_matches(line, printed[index], learned):
            return False
    return len(shown) == len(printed)


def _line_matches(shown: str, printed: str, learned: bool) -> bool:
    ends_early = shown.endswith("…")
    if ends_early:
        shown = shown.removesuffix("…").rstrip()
        words = _NUMBER.sub("#", shown)
        if not _NUMBER.sub("#", printed).startswith(words):
            return False
        printed = printed if learned else printed[: len(shown)]
    if not learned:
        return shown == printed
    if not ends_early and _words(shown) != _words(printed):
        return False
    pairs = zip(_values(shown), _values(printed), strict=False)
    return all(_near(first, second) for first, second in pairs)


def _words(line: str) -> list[str]:
    """Return a line's words in any order: counts that are close may change places."""
    return sorted(_NUMBER.sub("#", line).replace(",", " ").split())


def _values(line: str) -> list[float]:
    return [float(number.replace(",", "")) for number in _NUMBER.findall(line)]


def _near(first: float, second: float) -> bool:
    off = abs(first - second)
    if off <= SHARE * max(abs(first), abs(second)):
        return True
    whole = first == int(first) and second == int(second)
    return off <= (COUNT if whole else POINTS)


def stale(page: Path, run: Run = run) -> list[str]:
    """Run a page's commands; return a difference for each block that is no longer right.

    Args:
        page: A file of Markdown.
        run: How; each in a shell unless given.
    """
    return [text for _, text in _differences(page, run)]


def renew(page: Path) -> int:
    """Write what the commands print now into a page's blocks; return how many changed."""
    text = page.read_text("utf-8")
    changed = 0
    for block, printed in reversed(_printed(page, run)):
        if not _same(block, printed):
            end = block.start + len(block.text)
            text = text[: block.start] + printed + text[end:]
            changed += 1
    page.write_text(text, "utf-8")
    return changed


def _same(block: Block, printed: str) -> bool:
    learned = any(command.split()[1] in LEARNED for command in block.shown)
    return matches(block.text, printed, learned=learned)


def _printed(page: Path, run: Run) -> list[tuple[Block, str]]:
    """Return a page's blocks, each with what its commands print now."""
    found = []
    with tempfile.TemporaryDirectory() as name:
        for block in blocks(page.read_text("utf-8")):
            printed = run((*block.before, *block.shown), Path(name))
            found.append((block, "".join(printed[len(block.before) :])))
    return found


def _differences(page: Path, run: Run) -> Iterator[tuple[Block, str]]:
    for block, printed in _printed(page, run):
        if not _same(block, printed):
            lines = unified_diff(
                block.text.splitlines(),
                printed.splitlines(),
                str(page),
                block.shown[-1],
                lineterm="",
            )
            yield block, "\n".join(lines)


def main() -> None:
    """Compare, or with --write renew; exit code 1 where a block is stale."""
    words = sys.argv[1:]
    pages = [Path(word) for word in words if word != "--write"]
    found = 0
    for page in pages or [Path("README.md"), Path("docs/tutorial.md")]:
        if "--write" in words:
            print(f"{page}: {renew(page)} blocks renewed")
            continue
        for text in stale(page):
            print(text)
            found += 1
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
