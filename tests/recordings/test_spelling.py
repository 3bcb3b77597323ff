"""Claims about spelling: one form of a letter, and a word on look-alikes, no more."""

from taxel.recordings.spelling import composed, look_alikes


def test_letters_typed_in_two_ways_are_one_value():
    assert composed("cafe\u0301") == "caf\u00e9"
    assert look_alikes("label", [{"a": "cafe\u0301"}, {"a": "caf\u00e9"}]) == []


def test_values_that_differ_in_case_or_blanks_are_named_once():
    sets = [{"a": "Big Cup"}, {"a": "bigcup"}, {"a": "bigcup"}, {"a": "mug"}, {"b": "BIGCUP"}]

    assert look_alikes("label", sets) == [
        "label a: 'Big Cup', 'bigcup' differ in case or blanks only; they count as 2"
    ]
