"""Rows of small tables keep the numbers of their lines, and what is no table is one plain line."""

from pathlib import Path

import pytest

from taxel.errors import BadTable
from taxel.foreign.text_rows import rows_of
from taxel.recordings.trial_log import COLUMNS, read_trial_log

LONG = 140_000 * "x"
"""Longer than a cell may be for Python's reader."""


def written(folder: Path, text: str) -> Path:
    path = folder / "table.csv"
    path.write_text(text)
    return path


def test_remarks_and_empty_lines_are_left_out_and_counted(tmp_path: Path) -> None:
    path = written(tmp_path, '# of Monday\na,b\n\n  \n1,"#2"\n"3\n4",5\n6,7\n')

    assert rows_of(path, 1000) == [
        (2, ["a", "b"]), (5, ["1", "#2"]), (7, ["3\n4", "5"]), (8, ["6", "7"]),
    ]  # fmt: skip


def test_a_table_without_lines_has_no_rows(tmp_path: Path) -> None:
    assert rows_of(written(tmp_path, "\n# nothing\n"), 1000) == []


def test_a_cell_that_is_too_long_is_refused_in_one_line(tmp_path: Path) -> None:
    path = written(tmp_path, f"a\n{LONG}\n")

    with pytest.raises(BadTable, match=r"needed a table \(CSV\); got .*table.csv: field larger"):
        rows_of(path, 10**6)


@pytest.mark.parametrize(
    ("cells", "needed"),
    [
        (f"1,0,1,,,{LONG},,,,,", r"a table \(CSV\)"),
        (f"{5000 * '9'},0,1,,,,,,,,", "a number, began_s"),
    ],
)
def test_so_it_is_in_a_log_of_trials(tmp_path: Path, cells: str, needed: str) -> None:
    with pytest.raises(BadTable, match=needed):
        read_trial_log(written(tmp_path, f"{','.join(COLUMNS)}\n{cells}\n"))
