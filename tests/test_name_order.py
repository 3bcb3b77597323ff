"""Claims about the order of names."""

import pytest

from taxel.name_order import counting_order


@pytest.mark.parametrize(
    "names",
    [
        ["cup_1.mcap", "cup_2.mcap", "cup_10.mcap", "cup_100.mcap"],
        ["2", "10", "a", "a2b9", "a2b10", "a10b1"],
        ["day-1-run-9", "day-1-run-10", "day-2-run-1"],
        ["07", "7", "8"],
        ["1" * 5000, "2" * 5000, "1" * 5001],
        ["", "x", "x1", "y"],
        ["m1", "m²", "m³"],
    ],
)
def test_numbers_in_names_count_as_numbers(names: list[str]) -> None:
    """Of any length, anywhere in a name; what is no plain digit is text."""
    shuffled = names[1::2] + names[::2]

    assert sorted(shuffled, key=counting_order) == names


def test_names_that_differ_are_never_equal() -> None:
    """Otherwise the order would depend on how a folder lists its files."""
    assert counting_order("cup_01") != counting_order("cup_1")
