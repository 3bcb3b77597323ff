"""Hostile files, and which command is given which: the cases of `taxel bench faults` and the tests.

Each command must refuse in one plain line, with exit code 2, little memory, and soon. All command
lines are those of a folder that `make_world` has filled. Knows nothing about how they are run.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from taxel.bench.faults.hostile_files import (
    make_bundles,
    make_others,
    make_recordings,
    make_runs,
    make_tables,
)
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.simulated.data_sets import write_sessions

MOST_MB = 300
"""Largest memory of a process that refuses. Source: issue of hostile input."""
GROWTH_MB = 200
"""What a verb may take beside what stands in memory already: PyTorch alone takes 230 MB."""
MOST_S = 3.0
"""How long a refusal may take on an idle machine, seconds. Source: issue of hostile input."""
KINDS = {
    "bundles": "bundles",
    "recordings": "recordings",
    "tables": "tables",
    "runs": "runs",
    "code": "runs whose metadata would become C code",
    "others": "other files, folders and pipes",
}
"""Folder of the hostile files of a kind → the kind in words."""


def make_world(world: Path, main: Callable[[list[str]], object]) -> None:
    """Write honest things (`honest/`, `run/`, `good.taxel`), and what is made of them to harm.

    Args:
        world: An empty folder.
        main: Runs a command line of taxel, which may train.

    Raises:
        MissingExtra: The package onnx is not installed.
    """
    write_sessions(
        world / "honest", TengHandConfig(sessions=2, rate_hz=100.0, scans_per_class=3000),
        lambda _: None,
    )  # fmt: skip
    main(["train", str(world / "honest"), "--output", str(world / "run"), "--epochs", "1",
          "--no-check", "--json"])  # fmt: skip
    main(["bundle", str(world / "run"), "--output", str(world / "good.taxel"), "--json"])
    for name in KINDS:
        (world / name).mkdir()
    make_bundles(world / "bundles", world / "good.taxel")
    make_recordings(world / "recordings", world / "honest" / "session-1.mcap")
    make_tables(world / "tables")
    make_others(world / "others")
    make_runs(world / "runs", world / "code", world / "run")


def kind_of_case(line: str) -> str:
    """Return the folder of the hostile file that a command line names."""
    return next(kind for kind in KINDS if f"{kind}/" in line)


BUNDLES = (
    "member-of-6-gib member-that-lies unneeded-6-gib deep-json long-number twice-named "
    "latin-json npy-bomb npy-negative npy-nested loop wide-product long-work outside-data "
    "no-model two-classes-fewer classes-of-numbers steps-of-a-billion stride-of-text "
    "nan-scaling list-for-object encrypted odd-packing name-not-utf8 many-members sparse"
)
RECORDINGS = (
    "labels-as-a-list odd-tail short-message endless-length lz4-bomb lz4-bomb-said-small "
    "deep-mark long-number-mark nothing-but-heads sparse sparse-zeros"
)
TABLES = (
    "bomb.csv.gz sparse.csv sparse.npy npy-bomb.npy npy-nested.npy one-line.csv open-quote.csv "
    "nan.csv sparse.wav wav-lies.wav no-columns.mat"
)

ALONE: dict[str, str] = {
    **{
        f"live {name}": f"live bundles/{name}.taxel sim://teng --seconds 1"
        for name in BUNDLES.split()
    },
    **{f"info {name}": f"info recordings/{name}.mcap" for name in RECORDINGS.split()},
    **{f"import {name}": f"import tables/{name}.table --output out" for name in TABLES.split()},
    "import of many words": "import tables/many-words.table --output out",
    "import of a pipe": "import others/pipe.json --output out",
    "import of zeros without end": "import others/zero.json --output out",
    "replay of a lie": "live good.taxel replay://recordings/labels-as-a-list.mcap?speed=max",
    "replay of a pipe": "live good.taxel replay://others/pipe.mcap",
    "replay of zeros": "live good.taxel replay://others/zero.mcap",
    "bundle that is a pipe": "live others/pipe.taxel sim://teng",
    "bundle that is without end": "live others/zero.taxel sim://teng",
    "info of a pipe": "info others/pipe.mcap",
    "info of zeros without end": "info others/zero.mcap",
    "info of a folder with a pipe": "info others/pipes",
    "info of a folder with zeros": "info others/zeros",
    "info of a folder named so": "info others/folder.mcap",
    "recover of a pipe": "recover others/pipe.mcap --output out.mcap",
    "recover of zeros without end": "recover others/zero.mcap --output out.mcap",
    "recover of a hole": "recover recordings/sparse-zeros.mcap --output out.mcap",
    "label of a pipe": "label others/pipes",
    "view of a lie": "view recordings/labels-as-a-list.mcap",
    "view of a pipe": "view others/pipe.mcap",
}
"""Name → command line, of verbs that do without PyTorch: each in a process of its own."""
RESIDENT: dict[str, str] = {
    "train on a lie": "train recordings/labels-as-a-list.mcap --output out",
    "train on a pipe": "train others/pipes --output out",
    "audit of a pipe": "audit others/pipes",
    "evaluate a hole": "evaluate recordings/sparse-zeros.mcap",
    "report of deep tables": "report --tables others/deep.json --output out.html",
    "report of a pipe": "report --tables others/pipe.json --output out.html",
    "report of zeros": "report --tables others/zero.json --output out.html",
    "report of a hole": "report --tables others/sparse.json --output out.html",
    "report onto a pipe": "report run --output others/pipe.json",
    "compare deep runs": "compare run runs/deep-run",
    "bundle of a deep run": "bundle runs/deep-run --output out.taxel",
    "members below zero": "bundle runs/members-below-zero --output out.taxel",
    "members of a billion": "bundle runs/members-of-a-billion --output out.taxel",
    "steps of a billion": "bundle runs/steps-of-a-billion --output out.taxel",
    "adapt a pipe": "adapt others/pipe.taxel --history",
    "sweep a loop": "sweep bundles/loop.taxel --data honest",
    "sweep a pipe": "sweep others/pipe.taxel --data honest",
    "code in the software's name":
        "bundle code/software-that-ends-a-comment --board mega --output c --reference-mv 3300",
    "code in the digest": "bundle code/digest-of-code --board mega --output c --reference-mv 3300",
    "code in a class": "bundle code/class-of-code --board mega --output c --reference-mv 3300",
}  # fmt: skip
"""Name → command line, of verbs that load PyTorch: in a process that has loaded it."""
