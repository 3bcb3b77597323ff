"""A world in which everything below the verbs is a stand-in that records how it is called.

A verb then runs in milliseconds, and its log says all that it asked for: functions called below
`taxel.cli`, with their arguments, and what was printed. Two command lines that do the same thing
give the same log.
"""

from __future__ import annotations

import builtins
import dataclasses
import dis
import enum
import inspect
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from types import ModuleType
from typing import Any

import pytest
from fake_answers import ANSWERS, ATTRIBUTES, CALLED, FAKED, FAKED_VERB_PARTS, REAL, TEXTS
from rich.table import Table
from rich.text import Text

import taxel.cli
from taxel.cli.main import main

_VARYING = re.compile(r"/tmp/(taxel-|tmp)[\w-]+|done in \d+ s")
"""Names of scratch folders and times, which differ from run to run."""
OUTSIDE = ("taxel.cli", "taxel.errors", "taxel.plain_text")


class Fake:
    """Stands in for a function, a class or what they return."""

    def __init__(self, name: str, log: list[str]) -> None:
        self._name, self._log = name, log

    def __call__(self, *args: Any, **named: Any) -> Any:
        self._log.append(f"{self._name}({', '.join(map(shown, [*args, *sorted(named.items())]))})")
        for part in [*args, *named.values()]:
            if getattr(part, "__name__", "") in CALLED or (
                self._name.endswith("add_process") and inspect.isfunction(part)
            ):
                given = inspect.signature(part).parameters.values()
                part(*(Fake("given", self._log) for p in given if p.default is p.empty))
        answer = ANSWERS.get(self._name, lambda *_: ...)(*args)
        if answer is not ...:
            return answer
        return Fake(f"{self._name}()", self._log)

    def __getattr__(self, name: str) -> Fake:
        if name.startswith("__"):
            raise AttributeError(name)
        if name in TEXTS:
            return f"{self._name}.{name}"
        if name in ATTRIBUTES:
            return ATTRIBUTES[name]
        if name == "ended":  # a source: not at first, then yes
            self._log.append(asked := f"{self._name}.ended")
            return self._log.count(asked) > 1
        return Fake(f"{self._name}.{name}", self._log)

    def __rich__(self) -> str:
        return self._name

    def __enter__(self) -> Fake:
        return self

    def __exit__(self, *_: object) -> None: ...

    def __iter__(self) -> Iterator[Fake]:
        return iter([Fake(f"{self._name}[{at}]", self._log) for at in range(_wanted())])

    def __getitem__(self, key: object) -> Fake:
        return Fake(f"{self._name}[{shown(key)}]", self._log)

    def __instancecheck__(self, value: object) -> bool:
        return type(value) is Fake

    def __repr__(self) -> str:
        return self._name

    def __format__(self, _: str) -> str:
        return self._name

    def __fspath__(self) -> str:
        return self._name

    def __hash__(self) -> int:
        return hash(self._name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Fake | str) and str(other) == self._name

    def __len__(self) -> int:
        return 1

    def __contains__(self, _: object) -> bool:
        return False

    def __bool__(self) -> bool:
        return True

    def __index__(self) -> int:
        return 1

    def __float__(self) -> float:
        return 1.0

    def _same(self, *_: object) -> Fake:
        return self

    def _no(self, _: object) -> bool:
        return False

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = _same
    __rtruediv__ = __or__ = __ror__ = __and__ = __round__ = __neg__ = _same
    __lt__ = __le__ = __gt__ = __ge__ = _no


def _wanted() -> int:
    """Return how many values the code that iterates unpacks; 1 where it is no unpacking."""
    asking = sys._getframe(2)
    code = asking.f_code.co_code
    at = asking.f_lasti
    return code[at + 1] if dis.opname[code[at]] == "UNPACK_SEQUENCE" else 1


def shown(value: Any) -> str:
    """Return a value as the log has it; never a verb's options as a whole.

    A verb that handed itself on would make each of its options look used.
    """
    own = type(value).__module__.startswith("taxel.cli")
    if own and (hasattr(value, "run") or type(value).__name__.endswith("Options")):
        raise AssertionError(f"all options at once were handed on: {type(value).__name__}")
    if isinstance(value, Fake):
        return repr(value)
    if isinstance(value, Table):
        return f"table {value.title} {[[c.header, *map(str, c._cells)] for c in value.columns]}"
    if isinstance(value, Text):
        return value.plain
    if inspect.isgenerator(value):
        return shown(list(value))
    if callable(value) and not isinstance(value, type):
        return "a function"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        own = {f.name: shown(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return f"{type(value).__name__}{own}"
    if isinstance(value, dict):
        return str({str(key): shown(item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(shown, value))}]"
    return str(value) if isinstance(value, Path | str | int | float | bool | None) else repr(value)


def _stand_in(name: str, value: Any, log: list[str]) -> Any:
    """Return what stands in for something below the verbs; data stays data."""
    if isinstance(value, ModuleType):
        below = value.__name__.startswith("taxel.") and not value.__name__.startswith(OUTSIDE)
        return _Module(value, log) if below else value
    module = getattr(value, "__module__", "") or ""
    below = module.startswith("taxel.") and not module.startswith(OUTSIDE)
    if not below or name in REAL:
        return value
    if inspect.isfunction(value):
        return Fake(name, log)
    if inspect.isclass(value) and name in FAKED:
        return Fake(name, log)
    if inspect.isclass(value) and not (
        dataclasses.is_dataclass(value) or issubclass(value, BaseException | enum.Enum | tuple)
    ):
        return Fake(name, log)
    return value


class _Module:
    """A module below the verbs, as a verb's own `from … import …` finds it."""

    def __init__(self, module: ModuleType, log: list[str]) -> None:
        self._module, self._log = module, log

    def __getattr__(self, name: str) -> Any:
        return _stand_in(name, getattr(self._module, name), self._log)


def observe(words: Sequence[str], monkeypatch: pytest.MonkeyPatch) -> tuple[list[str], str]:
    """Run a command line in the fake world.

    Returns:
        The log, and the line with which it was refused or "".
    """
    _load_all()
    log: list[str] = []
    errors: list[str] = []
    with monkeypatch.context() as patch:
        _replace(patch, log)
        patch.setattr("taxel.cli.main._fail", _refuse(errors))
        try:
            main(words)
        except _Refused:
            return log, errors[0]
        except SystemExit as ended:
            log.append(f"exit {ended.code}")
        except Exception as error:
            if isinstance(error, AssertionError) and "all options" in str(error):
                raise
            log.append(f"beyond the stand-ins: {type(error).__name__}: {error}")
    return [_VARYING.sub("…", line) for line in log], ""


def _replaced(value: Any, **changes: Any) -> Any:
    if isinstance(value, Fake):
        return Fake(f"{value!r} with {shown(changes)}", value._log)
    return dataclasses.replace(value, **changes)


def _as_dict(value: Any) -> Any:
    return {"all of": value} if isinstance(value, Fake) else dataclasses.asdict(value)


_TOLERANT = {"replace": _replaced, "asdict": _as_dict}
"""What the standard library does for dataclasses, also for their stand-ins."""


@cache
def _load_all() -> None:
    """Import every verb, so that a module loaded on the way meets stand-ins too."""
    for module in walk_packages(taxel.cli.__path__, "taxel.cli."):
        import_module(module.name)


class _Refused(BaseException):
    """Stands for exit code 2."""


def _refuse(errors: list[str]) -> Callable[[str], None]:
    def fail(line: str) -> None:
        errors.append(line)
        raise _Refused

    return fail


@cache
def _below(module: ModuleType) -> list[tuple[str, Any]]:
    """Return the names of a verb's module for which something stands in, with what they are."""
    named = list(vars(module).items())
    return [(key, value) for key, value in named if _stand_in(key, value, []) is not value]


def _replace(patch: pytest.MonkeyPatch, log: list[str]) -> None:
    """Put stand-ins where verbs look: their modules' names, printing, and imports within them."""
    for name, module in list(sys.modules.items()):
        if name.startswith("taxel.cli") and name != "taxel.cli.main":
            for key, value in _below(module):
                patch.setattr(module, key, _stand_in(key, value, log))
            for key in ("say", "say_aside", "print_json", "console", "progress", "ask"):
                if key in vars(module) and name != "taxel.cli.printing":
                    patch.setattr(module, key, Fake(key, log))
            for key in list(vars(module)):
                if f"{name}.{key}" in FAKED_VERB_PARTS:
                    patch.setattr(module, key, Fake(key, log))
            for key, tolerant in _TOLERANT.items():
                if key in vars(module):
                    patch.setattr(module, key, tolerant)
    genuine = builtins.__import__

    def find(  # the names are Python's own
        name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0
    ) -> Any:
        module = genuine(name, globals, locals, fromlist, level)
        asked_by = (globals or {}).get("__name__", "")
        below = name.startswith("taxel.") and not name.startswith(OUTSIDE)
        if fromlist and below and asked_by.startswith("taxel.cli"):
            return _Module(module, log)
        return module

    patch.setattr(builtins, "__import__", find)
