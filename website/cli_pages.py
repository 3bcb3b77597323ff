"""The CLI reference: a page for each verb, from the dataclasses that its `--help` is made of.

Knows nothing about what a verb does.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from typing import Any

import tyro

from taxel.cli.main import KINDS, VERBS, load_verb
from taxel.cli.options.types import plain_types

CLI = "reference/cli"
_OPTION = re.compile(r"(?<![\w`-])--[a-z][\w-]*")
"""An option that a help text names."""


def cli_pages() -> dict[str, str]:
    """Return page → Markdown, for the command and each of its verbs."""
    pages = {f"{CLI}/{verb}.md": _verb_page(verb) for verb in VERBS}
    rows = [f"| [`taxel {verb}`]({verb}.md) | {_cell(text)} |" for verb, text in VERBS.items()]
    pages[f"{CLI}/index.md"] = "\n".join([
        "# The command `taxel`", "",
        "Made from the verbs themselves. The same text stands in `taxel VERB --help`.", "",
        "| verb | what it does |", "|---|---|", *rows, "",
    ])  # fmt: skip
    return pages


def _verb_page(verb: str) -> str:
    """Return a verb's page; where it has kinds, each with its options."""
    if verb not in KINDS:
        return "\n".join(_lines(_parser(verb), f"taxel {verb}", 1)) + "\n"
    lines = [f"# `taxel {verb}`", "", f"{VERBS[verb].capitalize()}.", ""]
    for kind in KINDS[verb]:
        lines += _lines(_parser(f"{verb} {kind}"), f"taxel {verb} {kind}", 2)
    return "\n".join(lines) + "\n"


def _parser(command: str) -> Any:
    """Return the options of a verb, or of a "verb kind", as tyro's own argparse holds them."""
    with warnings.catch_warnings():
        # The only way to a verb's options as data; taxel pins tyro below 2.
        warnings.simplefilter("ignore", DeprecationWarning)
        with plain_types():
            return tyro.extras.get_parser(load_verb(command), prog=f"taxel {command}")


def _lines(parser: Any, name: str, level: int) -> Iterator[str]:
    """Yield a heading, what the verb does, and a table of its options."""
    yield from (f"{'#' * level} `{name}`", "", (parser.description or "").strip(), "")
    options = [action for action in parser._actions if action.dest != "help"]
    if options:
        yield from ("| option | meaning | default |", "|---|---|---|")
        yield from map(_row, options)
        yield ""


def _row(action: Any) -> str:
    text, default = _meaning(str(action.help or "").replace("%%", "%"))
    kind = action.metavar if isinstance(action.metavar, str) else ""
    if not action.option_strings:
        shown = str(action.dest).upper()
        text += f" Of: {', '.join(kind[1:-1].split(','))}." if kind.startswith("{") else ""
    elif action.option_strings[-1].startswith("--no-"):
        on = default == "`True`"
        shown, default = ", ".join(action.option_strings[: 2 if on else 1]), "on" if on else ""
    else:
        shown = f"{action.option_strings[0]} {kind}".strip()
    text = _OPTION.sub(r"`\g<0>`", _cell(text))
    return f"| `{_cell(shown)}` | {text} | {_cell(default)} |"


def _meaning(text: str) -> tuple[str, str]:
    """Return an option's help and its default, which tyro writes at the help's end."""
    if text.endswith("(required)"):
        return text.removesuffix("(required)").strip(), "required"
    before, found, shown = text.rpartition("(default: ")
    if not found:
        return text.strip(), ""
    shown = shown.removesuffix(")")
    return before.strip(), "" if shown in ("", "None", "''") else f"`{shown}`"


def _cell(text: str) -> str:
    """Return text as one cell of a Markdown table; what looks like a tag stays text."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
