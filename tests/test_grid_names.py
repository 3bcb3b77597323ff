"""Where a channel lies in a grid by its name: one reading for imports and for models."""

import pytest

from taxel.grid_names import grid_place


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("r1c2", (("", ""), 1, 2)),
        ("R1C2", (("", ""), 1, 2)),
        ("thumb_r1c12", (("thumb_", ""), 1, 12)),
        ("row_3_col_4", (("", ""), 3, 4)),
        ("r1c2_x", (("", "_x"), 1, 2)),
        ("7r1c2 [N]", (("7", " [N]"), 1, 2)),
        ("sensor1c1_r2c3", (("sensor1c1_", ""), 2, 3)),
    ],
)
def test_rows_and_columns_are_read_and_the_rest_names_the_grid(
    name: str, place: tuple[tuple[str, str], int, int]
) -> None:
    assert grid_place(name) == place
    assert grid_place(name, in_words=True) == place


@pytest.mark.parametrize("name", ["", "force", "r1", "c1", "rc", "r12345c1", "r1c12345"])
def test_other_names_are_no_places(name: str) -> None:
    assert grid_place(name) is None
    assert grid_place(name, in_words=True) is None


@pytest.mark.parametrize(
    ("name", "place"), [("sensor2c1", ("senso", 2)), ("skinr2c1", ("skin", 2))]
)
def test_the_r_of_a_word_is_a_row_only_where_that_is_asked_for(
    name: str, place: tuple[str, int]
) -> None:
    """It may refuse what stands out of order; it may not make an image of sensors in a row."""
    assert grid_place(name) is None
    found = grid_place(name, in_words=True)
    assert found is not None
    assert (found.grid, found.row, found.column) == ((place[0], ""), place[1], 1)
