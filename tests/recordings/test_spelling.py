"""Claims about spelling: one form of a letter, and a word on look-alikes, no more."""

from taxel.recordings.imports.spelling import composed, look_alikes


def test_letters_typed_in_two_ways_are_one_value():
    assert composed("cafe\u0301") == "caf\u00e9"
    assert look_alikes("label", [{"a": "cafe\u0301"}, {"a": "caf\u00e9"}]) == []


def test_values_that_differ_in_case_or_blanks_are_named_once():
    sets = [{"a": "Big Cup"}, {"a": "bigcup"}, {"a": "bigcup"}, {"a": "mug"}, {"b": "BIGCUP"}]

    assert look_alikes("label", sets) == [
        "label a: 'Big Cup', 'bigcup' differ in case or blanks only; they count as 2"
    ]


def test_numbers_that_differ_in_zeros_only_are_named():
    """1, 01 and 1.0 are three classes, which a table out of two programs may not mean."""
    values = ("1", "01", "1.0", "10", "-1", "0", "-0", "1e0", "one")

    assert look_alikes("group", [{"subject": value} for value in values]) == [
        "group subject: '-0', '0' differ in how a number is written only; they count as 2",
        "group subject: '01', '1', '1.0' differ in how a number is written only; they count as 3",
    ]
