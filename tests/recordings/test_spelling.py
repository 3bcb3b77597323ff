"""Claims about spelling: one form of a letter, and a word on look-alikes, no more."""

from taxel.recordings.imports.spelling import composed, look_alikes, unknown_words


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


def test_words_for_an_unknown_value_are_named_and_none_is_a_value():
    """A cell with numpy's nan or R's NA became a class of that name without a word."""
    sets = [{"a": word} for word in ("nan", "NA", "nan", "none", "nano", "", "cup")]

    assert unknown_words("label", sets) == [
        "label a: 'NA' (1 ×), 'nan' (2 ×): taken as any other value; where it means that the label "
        "is unknown, leave the cell empty, or the trial out"
    ]
    assert unknown_words("group", [{"day": "NaN"}, {"day": "1"}]) == [
        "group day: 'NaN' (1 ×): taken as any other value; where it means that the group is "
        "unknown, leave those trials out"
    ]
    assert unknown_words("label", [{"a": "none"}, {}]) == []
