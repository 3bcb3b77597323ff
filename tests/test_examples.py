"""Every example runs as a reader would run it."""

import re
from pathlib import Path

import pytest
from forked import Forked

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
def test_an_example_runs_and_prints_something(path: Path, tmp_path: Path, forked: Forked):
    done = forked.run([], tmp_path, 300, path)

    assert done.code == 0, done.err
    assert done.out.strip()
    assert list(tmp_path.iterdir()) == [], "an example leaves nothing behind"
