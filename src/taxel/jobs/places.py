"""Where jobs run, by name and address: local, dask, ray or slurm. Imports only what is asked for.

    local                                   processes of this machine
    dask, dask://HOST:PORT                  Dask: a cluster on this machine, or a running scheduler
    ray, ray://HOST:PORT                    Ray: the same
    slurm, slurm://PARTITION?minutes=60&memory_gb=4&folder=PATH&executor=slurm|local

Source: docs/decisions/0050.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from taxel.errors import BadInput
from taxel.jobs.local import LocalEngine
from taxel.jobs.place import Place
from taxel.jobs.running import MOST_WORKERS, Engine, usual_workers

PLACE_VARIABLE = "TAXEL_RUN_ON"
"""Environment variable: where jobs run, where no option says."""
PLACES = ("local", "dask", "ray", "slurm")
CONNECT_S = 10.0
"""How long a scheduler may take to answer, seconds. Source: our choice, docs/decisions/0050."""
_SLURM_WORDS = ("minutes", "memory_gb", "folder", "executor")


_STARTED_BY = {
    "dask": ("a Dask scheduler", "dask scheduler --host 127.0.0.1"),
    "ray": ("a Ray cluster", "ray start --head --node-ip-address 127.0.0.1"),
}


def parse_place(text: str) -> Place:
    """Return the place that a text names.

    Raises:
        BadInput: It names none.
    """
    try:
        parts = urlsplit(text if "://" in text else f"{text}://")
    except ValueError as error:  # a bracket that is not closed, among others
        raise _no_place(text) from error
    words = dict(parse_qsl(parts.query, keep_blank_values=True))
    known = _SLURM_WORDS if parts.scheme == "slurm" else ()
    wrong = parts.scheme not in PLACES or parts.path or set(words) - set(known)
    if wrong or (parts.scheme == "local" and parts.netloc):
        raise _no_place(text)
    if words.get("executor", "slurm") not in ("slurm", "local"):
        raise BadInput("executor=slurm or executor=local", repr(words["executor"]), "name one")
    return Place(
        engine=parts.scheme,
        address=parts.netloc,
        minutes=_count(words, "minutes", 60),
        memory_gb=_count(words, "memory_gb", 4),
        folder=Path(words.get("folder", "taxel-slurm")),
        executor=words.get("executor", "slurm"),
    )


def open_engine(
    run_on: str | None = None,
    workers: int | None = None,
    log: Callable[[str], None] = lambda _: None,
) -> Engine:
    """Return an engine that is ready for jobs; use it in a `use_engine` block, which closes it.

    Args:
        run_on: Where, as in the head of this module; $TAXEL_RUN_ON or local unless given.
        workers: Jobs at a time; `usual_workers` unless given. A running scheduler has its own.
        log: Called with lines of the log.

    Raises:
        BadInput: There is no such place, or nobody answers there.
        MissingExtra: The engine is not installed.
    """
    place = parse_place(run_on or os.environ.get(PLACE_VARIABLE) or "local")
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise BadInput(f"--workers within 1 and {MOST_WORKERS}", str(workers), "choose another")
    count = workers or usual_workers()
    if place.address and place.engine in _STARTED_BY:
        check_answers(place.address, *_STARTED_BY[place.engine])
    if place.engine == "dask":
        from taxel.jobs.dask_engine import DaskEngine

        return DaskEngine(place.address, count, log)
    if place.engine == "ray":
        from taxel.jobs.ray_engine import RayEngine

        return RayEngine(place.address, count, log)
    if place.engine == "slurm":
        from taxel.jobs.slurm_engine import SlurmEngine

        return SlurmEngine(place, count, log)
    return LocalEngine(count, log)


def check_answers(address: str, what: str, start: str) -> None:
    """Refuse an address at which nobody listens: the engines' own clients ask on for minutes.

    Args:
        address: HOST:PORT.
        what: Who should be there.
        start: The command that starts it.

    Raises:
        BadInput: Nobody listens there, or it is no address.
    """
    try:
        parts = urlsplit(f"//{address}")
        socket.create_connection((parts.hostname, parts.port), CONNECT_S).close()
    except (OSError, TypeError, ValueError) as error:
        raise BadInput(
            f"{what} at {address}", f"none that answers ({error})", f"start one with: {start}"
        ) from error


def _no_place(text: str) -> BadInput:
    return BadInput(
        "local, dask, dask://HOST:PORT, ray, ray://HOST:PORT, slurm or slurm://PARTITION",
        repr(text), "name one of them with --run-on",
    )  # fmt: skip


def _count(words: dict[str, str], name: str, usual: int) -> int:
    text = words.get(name, str(usual))
    if not text.isdecimal() or not 1 <= int(text) <= 100_000:
        raise BadInput(f"a whole number from 1 for {name} of --run-on", repr(text), "give another")
    return int(text)
