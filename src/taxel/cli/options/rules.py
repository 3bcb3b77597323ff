"""Options that change nothing unless something stands beside them: refused, not ignored.

A verb's `RULES` say which; `taxel.cli.main` applies them to the options that were typed. Knows
nothing about any verb.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from taxel.errors import BadInput


@dataclass(frozen=True, slots=True)
class Only:
    """Options of a verb that mean something only where `when` holds."""

    options: tuple[str, ...]
    """As they are typed, without dashes: "fold-count"."""
    need: str
    """What must be, such as "--page" or "no --json"."""
    when: Callable[[Any], object]
    """Of the verb's options; whether these options change what is done."""
    against: Callable[[Any], str] | None = None
    """Of the verb's options; the option as typed that these do not go with, where several may be
    it: "--split random"."""


def typed_options(words: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the options among words as typed, each once, without dashes.

    Flags come as they are: --no-check gives "no-check".
    """
    names = (
        word[2:].partition("=")[0].replace("_", "-") for word in words if word.startswith("--")
    )
    return tuple(dict.fromkeys(name for name in names if name))


def check_rules(verb: object, words: Sequence[str]) -> None:
    """Refuse an option that was typed and would change nothing.

    Args:
        verb: Its options, with a class variable `RULES` where it has rules.
        words: What was typed after the verb.

    Raises:
        BadInput: Such an option was typed.
    """
    typed = {name.removeprefix("no-"): name for name in typed_options(words)}
    rules: tuple[Only, ...] = getattr(verb, "RULES", ())
    for rule in rules:
        for option in rule.options:
            if option in typed and not rule.when(verb):
                if rule.against is not None:
                    other = rule.against(verb)
                    raise BadInput(
                        f"--{typed[option]} or {other}",
                        f"both; beside {other}, --{typed[option]} would change nothing",
                        "leave one of the two out",
                    )
                raise BadInput(
                    f"{rule.need} beside --{typed[option]}",
                    f"--{typed[option]}, which would change nothing",
                    "leave it out",
                )
