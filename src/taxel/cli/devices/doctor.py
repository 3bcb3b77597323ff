"""`taxel doctor`: what this machine lacks for live work, and how to mend it.

Required is what every live session needs, on simulators too: the packages of the live path, a
folder with 2 GB to spare, and shared memory. All else is optional: it is needed only with the
device or the speed that its line names.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

from rich.text import Text

from taxel.cli.extras import EXTRAS, LIVE_PACKAGES
from taxel.cli.printing import console, print_json
from taxel.errors import BadInput
from taxel.plain_text import visible_line

_EXTRAS = ("camera", "serial", "gripper", "page", "sign", "sim", "train")
"""Extras that live work may need."""
GROUPS = {"dialout": ("ttyACM*", "ttyUSB*"), "video": ("video*",)}
"""Group → the device nodes that it opens."""
SHARED_BYTES = 64 << 20
"""Shared memory that a session takes at most. Source: our choice, docs/decisions/0015."""
FREE_BYTES = 2 << 30
"""Two cameras of 40 kB a frame at 25 frames/s fill 2 MB/s: a quarter of an hour. Our choice,
docs/decisions/0015."""
WRITE_MB_S = 20.0
"""Ten times what those cameras write, megabytes a second. Our choice, docs/decisions/0015."""
_TRIAL_BYTES = 16 << 20
"""Written to measure the disk's speed."""
_STEADY_CLOCKS = ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page", "xen")


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing that was looked at."""

    name: str
    ok: bool
    found: str
    """What was seen."""
    mend: str = ""
    """What to do where it is not well."""
    required: bool = False
    """Whether no live session can do without."""


@dataclass(frozen=True, kw_only=True)
class Doctor:
    """List what this machine lacks for live work, and how to mend it.

    Exit code 0 if everything required is there, even where optional things are missing; 1 if
    something required is missing.
    """

    output: Path = Path()
    """Folder where recordings would go; its space and speed are measured with a 16 MB file."""
    json: bool = False
    """Print JSON: a list of {name, ok, found, mend, required}."""

    def run(self) -> None:
        """Look at everything and print it."""
        if not self.output.is_dir():
            raise BadInput("a folder for --output", str(self.output), "name one that exists")
        checks = list(examine(self.output))
        if self.json:
            print_json([asdict(check) for check in checks])
        else:
            for line in report(checks):
                console.print(line, soft_wrap=True)
        if any(check.required and not check.ok for check in checks):
            sys.exit(1)


def report(checks: list[Check]) -> list[Text]:
    """Return the lines for a person; missing ones say how to mend."""
    lines = []
    for check in checks:
        colour = "green" if check.ok else "red" if check.required else "yellow"
        word = "ok" if check.ok else "missing"
        mend = "" if check.ok else f"; {check.mend}"
        line = visible_line(f"{check.name}: {check.found}{mend}")
        lines.append(Text.assemble((f"{word:<8}", colour), line))
    required = sum(check.required and not check.ok for check in checks)
    optional = sum(not check.required and not check.ok for check in checks)
    if required:
        end = f"Live work cannot start: {required} required missing, {optional} optional."
    else:
        end = f"Live work can start: all required is there; {optional} optional missing."
    return [*lines, Text(end)]


def examine(output: Path, root: Path = Path("/")) -> Iterator[Check]:
    """Yield all checks.

    Args:
        output: Folder where recordings would go.
        root: Where dev and sys lie.
    """
    yield packages("live path", LIVE_PACKAGES, "taxel", required=True)
    for extra in _EXTRAS:
        modules, purpose = EXTRAS[extra]
        yield packages(f"extra {extra}, for {purpose}", modules, f"taxel[{extra}]")
    yield shared_memory(root / "dev" / "shm")
    yield folder(output)
    yield write_speed(output)
    for group, patterns in GROUPS.items():
        yield device_nodes(group, patterns, root / "dev")
    yield cores(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity")
                else os.cpu_count() or 1)  # fmt: skip
    yield real_time()
    yield governor(root / "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
    yield clock_source(root / "sys/devices/system/clocksource/clocksource0/current_clocksource")
    yield Check(name="browser", ok=True, found="none is needed here: the page opens on any machine")


def packages(name: str, modules: tuple[str, ...], install: str, required: bool = False) -> Check:
    """Look for importable packages."""
    absent = [module for module in modules if find_spec(module) is None]
    return Check(
        name=f"packages of the {name}" if required else name,
        ok=not absent,
        found=f"without {', '.join(absent)}" if absent else "all installed",
        mend=f"run: pip install '{install}'",
        required=required,
    )


def shared_memory(place: Path) -> Check:
    """Look for memory that processes share."""
    free = shutil.disk_usage(place).free if place.is_dir() else 0
    return Check(
        name="shared memory",
        ok=free >= SHARED_BYTES and hasattr(os, "memfd_create"),
        found=f"{free >> 20} MB free of {SHARED_BYTES >> 20} needed, in {place}",
        mend="in a container, start it with --shm-size=256m",
        required=True,
    )


def folder(output: Path) -> Check:
    """Look at the place where recordings would go."""
    free = shutil.disk_usage(output).free
    writable = os.access(output, os.W_OK)
    return Check(
        name="place for recordings",
        ok=writable and free >= FREE_BYTES,
        found=f"{free / 1e9:.1f} GB free in {output.resolve()}"
        + ("" if writable else ", which cannot be written"),
        mend=f"free {FREE_BYTES / 1e9:.0f} GB, or name another folder with --output",
        required=True,
    )


def write_speed(output: Path) -> Check:
    """Write a file down to the disk, and take the time; required is only that it can be written."""
    part = os.urandom(1 << 20)
    try:
        with tempfile.TemporaryFile(dir=output) as file:
            begun_s = time.perf_counter()
            for _ in range(_TRIAL_BYTES >> 20):
                file.write(part)
            file.flush()
            os.fsync(file.fileno())
            speed = _TRIAL_BYTES / 1e6 / (time.perf_counter() - begun_s)
    except OSError as error:
        return Check(
            name="writing there",
            ok=False,
            found=f"failed: {(error.strerror or str(error)).lower()}",
            mend="name another folder with --output",
            required=True,
        )
    return Check(
        name="writing there",
        ok=speed >= WRITE_MB_S,
        found=f"{speed:.0f} MB/s of {WRITE_MB_S:.0f} needed",
        mend="record to a faster disk",
    )


def device_nodes(group: str, patterns: tuple[str, ...], dev: Path) -> Check:
    """Look whether the nodes of boards or cameras may be opened, now or once plugged in."""
    nodes = sorted(node for pattern in patterns for node in dev.glob(pattern))
    closed = [node.name for node in nodes if not os.access(node, os.R_OK | os.W_OK)]
    member = os.geteuid() == 0 or group in _own_groups()
    what = f"{len(nodes)} device{'s' * (len(nodes) != 1)} ({', '.join(patterns)})"
    if closed:
        what += f", no permission for {', '.join(closed)}"
    return Check(
        name=f"group {group}",
        ok=not closed and member,
        found=f"{'member' if member else 'not a member'}, {what}",
        mend=f"run: sudo usermod -aG {group} $USER, then log in again",
    )


def cores(count: int) -> Check:
    """Look at the number of processor cores."""
    return Check(
        name="processor cores",
        ok=count >= 2,
        found=str(count),
        mend="on one core acquisition and decisions wait for each other; use two or more",
    )


def real_time(permitted: bool | None = None) -> Check:
    """Look whether sources, monitors and the supervisor may run before all other work.

    Args:
        permitted: Tried here unless given.
    """
    if permitted is None:
        from taxel.live.station.worker import may_run_in_real_time

        permitted = may_run_in_real_time()
    return Check(
        name="real-time scheduling",
        ok=permitted,
        found="permitted" if permitted else "not permitted",
        mend="alarms may wait milliseconds for other work; add the line '@dialout - rtprio 3' to "
        "/etc/security/limits.d/taxel.conf and log in again; in a container, start it with "
        "--cap-add=SYS_NICE",
    )


def governor(file: Path) -> Check:
    """Look at how the processor's clock is governed."""
    found = _read(file)
    return Check(
        name="processor's clock",
        ok=found not in ("powersave", "conservative"),
        found=found or "not governed from here",
        mend="latency may rise while it wakes; run: sudo cpupower frequency-set -g performance",
    )


def clock_source(file: Path) -> Check:
    """Look at the clock that all stamps come from."""
    found = _read(file)
    fine = time.get_clock_info("monotonic").resolution <= 1e-6
    return Check(
        name="clock of the stamps",
        ok=fine and (not found or found.startswith(_STEADY_CLOCKS)),
        found=found or "not known here",
        mend="it is slow to read; see the kernel's log for why tsc was given up",
    )


def _own_groups() -> set[str]:
    import grp

    names = set()
    for number in {os.getegid(), *os.getgroups()}:
        try:
            names.add(grp.getgrgid(number).gr_name)
        except KeyError:
            continue  # a number without a name, as in containers
    return names


def _read(file: Path) -> str:
    try:
        return file.read_text().strip()
    except OSError:
        return ""
