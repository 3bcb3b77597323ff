"""Every example runs as a reader would run it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("[0-9][0-9]_*.py"))
LONGEST = 40
"""Lines that an example stays below: more is no example."""


def test_there_is_an_example_for_each_place_named_in_where_things_go():
    page = (EXAMPLES[0].parents[1] / "docs" / "where-things-go.md").read_text("utf-8")

    assert [path.name for path in EXAMPLES if path.name not in page] == []
    assert len(EXAMPLES) >= 6


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_and_says_what_it_shows(path: Path):
    text = path.read_text("utf-8")

    assert text.startswith('"""')
    assert len(text.splitlines()) < LONGEST
    assert not re.search(r"(/work/|/home/|/tmp/|/root/)", text)  # a folder of one machine


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_prints_something(path: Path, tmp_path: Path):
    done = subprocess.run(
        [sys.executable, str(path)],
        cwd=tmp_path,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONIOENCODING": "utf-8"},
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=300,
        check=False,
    )

    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert list(tmp_path.iterdir()) == [], "an example leaves nothing behind"
