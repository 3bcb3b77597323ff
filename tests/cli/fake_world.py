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
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from rich.table import Table
from rich.text import Text

import taxel.cli
from taxel.cli.main import main

REAL = {
    "find_recipe", "parse_reference", "checked_config", "find_bundle", "shipped_bundle",
    "rule_named", "plan_rows", "list_runs", "section_plan", "titles", "without_controls",
    "visible_line", "visible", "shell_words", "json_text", "parse_options", "recordings_of",
}  # fmt: skip
"""Functions that only compute and that verbs need to go on; they stay as they are."""
_VARYING = re.compile(r"/tmp/(taxel-|tmp)[\w-]+|done in \d+ s")
"""Names of scratch folders and times, which differ from run to run."""
FAKED = {
    "BackboneExtractor",
    "Station",
    "Bundle",
    "Made",
    "Manifest",
    "Correction",
    "StationPage",
    "Samples",
}
"""Data classes that do work; not their data but what is asked of them counts."""
CALLED = {"open_way", "show", "on_tick"}
"""Functions that a verb hands on to be called, and that use its options."""
FAKED_VERB_PARTS = {
    "taxel.cli.train.warning",
    "taxel.cli.train_monitor._check",
    "taxel.cli.view.show",
    "taxel.cli.label._print",
    "taxel.cli.label._plain",
    "taxel.cli.info._print_recording",
    "taxel.cli.info._print_folder",
    "taxel.cli.flash.hear_hello",
    "taxel.cli.flash.check_port",
    "taxel.cli.flash._run",
    "taxel.cli.flash_tools.commands",
    "taxel.cli.flash.commands",
    "taxel.cli.train_monitor._contract",
    "taxel.cli.flash._dotted",
    "taxel.cli.import_._of_videos",
    "taxel.cli.bench.import_module",
    "taxel.cli.doctor.write_speed",
    "taxel.cli.calibrate_cycles.measure_cycles",
    "taxel.cli.calibrate_cycles.write_cycles",
    "taxel.cli.power.estimate_power",
    "taxel.cli.power._print",
    "taxel.cli.record.ledger_line",
    "taxel.cli.record_plan.record_plan",
    "taxel.cli.hand.use_hand",
    "taxel.cli.hand._line",
    "taxel.cli.collect.collect_plan",
    "taxel.cli.live_station._free_port",
    "taxel.cli.live_station.token_urlsafe",
    "taxel.cli.find.find_boards",
    "taxel.cli.find.find_cameras",
    "taxel.cli.find.find_scene_cameras",
}
"""Parts of verbs that compute with what stand-ins cannot give, or that touch devices."""


class _Any(str):
    """Equals whatever a board was told to be."""

    __hash__ = str.__hash__

    def __eq__(self, _: object) -> bool:
        return True

    def __ne__(self, _: object) -> bool:
        return False

    def __str__(self) -> str:
        return self


_SUMMARY = {
    "windows": 3, "filled": 1, "answers": {"cup": 3}, "marked": 2, "right": 1, "grasps": 1,
    "grasps_right": 1, "latency_us_median": 1.0, "latency_us_p99": 1.0, "target": "object",
    "gate_moves": [], "actions": {},
}  # fmt: skip
ATTRIBUTES: dict[str, Any] = {
    "measured": {},
    "disarms": False,
    "shown": ("STABLE",),
    "latencies": SimpleNamespace(percentiles_ms=dict),
    "decision": SimpleNamespace(state=SimpleNamespace(name="STABLE"), reason="", slip=None),
    "feeds": [SimpleNamespace(url="sim://cup-pour", worker=SimpleNamespace(name="w"))],
}
"""Attribute → its value, where a verb's way goes by it."""
ANSWERS: dict[str, Any] = {
    "is_grasp_bundle": lambda path: "cup" in str(path),
    "is_trial_bundle": lambda path: "trial" in str(path).rpartition("/")[2],
    "are_camera_trials": lambda path: "trial" in str(path).rpartition("/")[2],
    "named_path": lambda path: path,
    "check_page": lambda _: False,
    "list_recordings": lambda path: (
        [Path("a.mcap"), Path("b.mcap")] if str(path) == "folder" else [Path(path)]
    ),
    "write_pours": lambda _, config, *__: [
        {"force_n": force, "outcome": "hold", "slip_um": 1.0, "run": "r"}
        for force in config.forces_n
    ],
    "write_bundle": lambda path, *_: _touched(path),
    "train_bundle": lambda _, __, path, *___: _touched(path),
    "Recorder": lambda path, *_: _touched(path),
    "mark_recordings": lambda *_: SimpleNamespace(
        recordings=[Path("a.mcap")], marks=[], replaced=0, left_out=[]
    ),
    "run_session": lambda _, recognisers, *__: [
        SimpleNamespace(summary=lambda: dict(_SUMMARY)) for _ in recognisers
    ],
    "run_grasp_session": lambda *_: SimpleNamespace(
        summary=lambda: {"states": {}, "moments": 0, "alarms": 0, "grasps": []}
    ),
    "hear_hello": lambda *_: SimpleNamespace(
        protocol=_Any(), firmware=_Any(), board=_Any(), board_id=_Any()
    ),
    "import_module": lambda _: SimpleNamespace(
        quick_steps=lambda: [("given", None), ("other", None)],
        full_steps=lambda data: [(f"given {data}", None)],
        data_digest=str,
    ),
    "_of_videos": lambda path: "videos" in str(path),
    "record_presses": lambda _, path, *__: _touched(path),
    "plan_array": lambda *_: {"noise": (1.0,)},
    "find_boards": lambda: ([], []),
    "find_cameras": list,
    "find_scene_cameras": lambda: ([], []),
}
"""Function → what it answers, where a verb's way goes by it."""
TEXTS = {"digest", "url", "words", "plain"}
"""Attributes that verbs join to text."""
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


def _touched(path: Path) -> Any:
    """Make the file that a function below would have written; nothing else is answered."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return ...


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


def _replace(patch: pytest.MonkeyPatch, log: list[str]) -> None:
    """Put stand-ins where verbs look: their modules' names, printing, and imports within them."""
    for name, module in list(sys.modules.items()):
        if name.startswith("taxel.cli") and name != "taxel.cli.main":
            for key, value in list(vars(module).items()):
                stand_in = _stand_in(key, value, log)
                if stand_in is not value:
                    patch.setattr(module, key, stand_in)
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
