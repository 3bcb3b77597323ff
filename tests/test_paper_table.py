"""The table of what the two papers describe is true: its files and commands exist."""

import re
from pathlib import Path

import pytest

from taxel.cli.main import VERBS

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "papers.md"
ROW = re.compile(
    r"^\| (?P<where>[^|]+) \| (?P<what>[^|]+) \| (?P<state>[^|]+) \| (?P<how>[^|]+) \|$"
)
STATES = ("there", "in part", "missing", "needs materials or hardware", "theirs alone")


def rows() -> list[dict[str, str]]:
    found = [ROW.match(line) for line in PAGE.read_text("utf-8").splitlines()]
    named = [{k: v.strip() for k, v in match.groupdict().items()} for match in found if match]
    return [row for row in named if row["where"] not in ("where", "---")]


def test_every_row_says_where_it_is_or_why_not():
    for row in rows():
        assert row["state"] in STATES, row
        assert row["how"], row
        if row["state"] == "there":
            assert "`" in row["how"], row


def test_the_page_counts_its_rows_as_they_are():
    text = PAGE.read_text("utf-8")
    for state in STATES:
        count = sum(row["state"] == state for row in rows())
        assert f"{count} {state}" in text, (state, count)
    assert f"{len(rows())} things" in text


@pytest.mark.parametrize("row", rows(), ids=lambda row: f"{row['where']}: {row['what'][:40]}")
def test_each_file_and_each_verb_that_a_row_names_exists(row: dict[str, str]):
    named = re.findall(r"`([^`]+)`", row["how"])
    for words in named:
        if words.startswith("taxel "):
            assert words.split()[1] in VERBS, words
        elif "/" in words and "://" not in words:
            assert (ROOT / words).exists() or (ROOT / "src" / "taxel" / words).exists(), words
