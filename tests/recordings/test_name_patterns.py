"""Claims about patterns of file names: what a name is read as, held against regular expressions."""

import re
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.errors import BadTable
from taxel.recordings.imports.name_patterns import FilePattern, NamePattern, pattern_of


def step(cell: str) -> NamePattern:
    """Return the pattern of a single name."""
    pattern = pattern_of(cell, "table.csv, line 2")
    assert pattern is not None
    (only,) = pattern.steps
    assert isinstance(only, NamePattern)
    return only


@pytest.mark.parametrize(
    ("cell", "name", "read"),
    [
        ("{label:object}_{group:force}_trial{group:n}.csv", "cup_25N_trial3.csv",
         {"label:object": "cup", "group:force": "25N", "group:n": "3"}),
        ("{label:a}_{label:b}.csv", "x_y_z.csv", {"label:a": "x", "label:b": "y_z"}),
        ("{label:a}_{label:b}.csv", "__.csv", None),
        ("{label:a}_{label:b}.csv", "___.csv", {"label:a": "_", "label:b": "_"}),
        ("*_{label:b}.csv", "_y.csv", {"label:b": "y"}),
        ("{label:a}.csv", "x.csv.csv", {"label:a": "x.csv"}),
        ("{label:a}.csv", ".csv", None),
        ("{label:a}.csv", "x.csv.gz", None),
        ("{label:a}*.csv".replace("*", "_*"), "x_.csv", {"label:a": "x"}),
        ("trial?.csv", "trial7.csv", {}),
        ("trial?.csv", "trial77.csv", None),
        ("{ Label: Big Thing }.csv", "x.csv", {"label:Big Thing": "x"}),
        ("{label:a}.csv", "._x.csv", None),
        (".{label:a}.csv", "._x.csv", {"label:a": "_x"}),
        ("{label:a}.(csv)+", "x.(csv)+", {"label:a": "x"}),
        ("caf\u00e9_{label:a}.csv", "caf\u00e9_\u00e9.csv", {"label:a": "\u00e9"}),
        ("{label:a}_1.csv", "x\ny_1.csv", {"label:a": "x\ny"}),
        ("{label:a}{digits}.csv", "bottle12.csv", {"label:a": "bottle"}),
        ("{label:a}{group:n:digits}.csv", "b2b_012.csv", {"label:a": "b2b_", "group:n": "012"}),
        ("{label:a}{group:n:digits}.csv", "bottle.csv", None),
        ("{label:a}{digits}.csv", "12.csv", None),
        ("{digits}{label:a}_*.csv", "12cup_3.csv", {"label:a": "cup"}),
        ("trial{ group:n : digits }.csv", "trial7b.csv", None),
        ("{label:a}_{group:n:digits}.csv", "big_cup_12.csv",
         {"label:a": "big_cup", "group:n": "12"}),
        ("{label:a}_trial{digits}.csv", "x_trial_trial3.csv", {"label:a": "x_trial"}),
        ("{label:digits}.csv", "12.csv", {"label:digits": "12"}),
        ("{group:n:Digits}.csv", "12.csv", {"group:n": "12"}),
        ("*{group:n:digits}{label:a}.csv", "3cup.csv", {"group:n": "3", "label:a": "cup"}),
    ],
)  # fmt: skip
def test_a_part_takes_as_little_as_it_can_from_the_left(cell, name, read):
    assert step(cell).read(name) == read


def test_parts_end_with_their_folder():
    pattern = pattern_of("data/{group:day}/{label:object}_*.csv", "line 2")
    assert isinstance(pattern, FilePattern)
    assert pattern.steps[0] == "data"
    assert pattern.columns == ["group:day", "label:object"]
    assert [type(part) for part in pattern.steps[1:]] == [NamePattern, NamePattern]
    assert pattern_of("data/cup_1.csv", "line 2") is None


TEXTS = st.lists(st.text("ab_?", min_size=1, max_size=3).filter(lambda t: t.strip("?")),
                 min_size=1, max_size=3)  # fmt: skip
ENDS = st.text("ab_", max_size=2)


@given(
    ENDS, TEXTS, ENDS, st.lists(st.booleans(), min_size=4, max_size=4), st.text("ab_", max_size=12)
)
def test_a_name_is_read_as_by_a_regular_expression_that_tries_all_ways(
    head, between, tail, says, name
):
    """The shortest way first, `.+?`; from the right, the longest first, `.+`."""
    parts = [f"{{label:{i}}}" if says[i] else "*" for i in range(len(between) + 1)]
    texts = [head, *between, tail]
    cell = head + "".join(part + text for part, text in zip(parts, texts[1:], strict=True))
    plain = [re.escape(text).replace(re.escape("?"), ".") for text in texts]

    def oracle(lazy: str) -> dict[str, str] | None:
        signs = [("(.+" if own else "(.*") + lazy + ")" for own in says[: len(parts)]]
        made = plain[0] + "".join(map("".join, zip(signs, plain[1:], strict=True)))
        found = re.fullmatch(made, name)
        pairs = zip(parts, found.groups() if found else (), strict=bool(found))
        named = {part.strip("{}"): value for part, value in pairs if part != "*"}
        return named if found else None

    assert step(cell).read(name) == oracle("?")
    if oracle("?") is not None:
        assert step(cell).read_from_right(name) == oracle("")


SIGNS = {"{label:%d}": "(.+?)", "*": "(.*?)", "{digits}": "(?<![0-9])([0-9]+)(?![0-9])",
         "{group:%d:digits}": "(?<![0-9])([0-9]+)(?![0-9])"}  # fmt: skip


@given(
    st.lists(st.sampled_from(list(SIGNS)), min_size=2, max_size=4),
    st.lists(st.sampled_from(["", "_", "ab", "a_"]), min_size=5, max_size=5),
    st.text("ab_12", max_size=10),
)
def test_numbers_are_read_as_by_a_regular_expression_that_tries_all_ways(kinds, texts, name):
    parts = [kind % place if "%" in kind else kind for place, kind in enumerate(kinds)]
    between = zip(parts, kinds, texts[1:], strict=False)
    cell, plain = texts[0], texts[0]
    for part, kind, text in between:
        cell, plain = cell + part + text, plain + SIGNS[kind] + text
    try:
        pattern = step(cell)
    except BadTable:
        return  # two parts that only a number could tell apart
    found = re.fullmatch(plain, name)
    says = [part.strip("{}").removesuffix(":digits") for part in parts]
    pairs = zip(says, found.groups(), strict=True) if found else ()

    named = {key: value for key, value in pairs if ":" in key}
    assert pattern.read(name) == (named if found else None)
    if found:
        assert set(pattern.read_from_right(name)) == set(named)


@given(st.lists(st.text("abc1", min_size=1, max_size=5), min_size=1, max_size=4))
def test_values_that_hold_no_separator_come_back_as_they_were_and_in_one_way(values):
    cell = "_".join(f"{{label:{i}}}" for i in range(len(values))) + ".csv"
    pattern, name = step(cell), "_".join(values) + ".csv"

    assert pattern.read(name) == {f"label:{i}": value for i, value in enumerate(values)}
    assert pattern.read_from_right(name) == pattern.read(name)


def test_no_name_takes_long():
    """Trying all ways would take longer than the universe has lasted."""
    before = time.process_time()
    assert step("*_" * 40 + "x.csv").read("_" * 250 + ".csv") is None
    assert time.process_time() - before < 1.0


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("{object}.csv", r"got '{object}' in the column 'file' in line 2; write it as {label:obj"),
        ("{camera:left}.csv", "got '{camera:left}'"),
        ("{label:}.csv", "got '{label:}'"),
        ("{}.csv", "got '{}'"),
        ("{label:a.csv", "got '{'"),
        ("label:a}.csv", "got '}'"),
        ("{label:a/b}.csv", "got '{'"),
        ("{label:a}{label:b}.csv", r"got {label:a}{label:b} in line 2; write what stands between"),
        ("{label:a}*.csv", r"got {label:a}\*"),
        ("{label:a}{label:b}.csv", "say which of them is a number, as {group:take:digits}"),
        ("{group:a:digits}{digits}.csv", "got {group:a:digits}{digits} in line 2; write what"),
        ("t0{group:n:digits}.csv", "got t0{group:n:digits}.csv in line 2; leave those digits out"),
        ("{digits}0.csv", "got {digits}0.csv"),
        ("{order:run:digits}.csv", "write it as {label:run:digits} or {group:run:digits}"),
        (
            "{order:trial:digits}.csv",
            "write it as {label:trial_number:digits} or {group:trial_number:digits}",
        ),
        ("{object:digits}.csv", "write it as {label:object:digits} or {group:object:digits}"),
        ("{label}.csv", "write it as {label:label}"),
        ("{digit}.csv", "got '{digit}'"),
        ("{label::digits}.csv", "got '{label::digits}'"),
        ("{label:a}?{label:b}.csv", r"got {label:a}\?{label:b}"),
        ("**/{label:a}.csv", r"got \*\* in line 2; write \*/ for each folder"),
        ("{label:a}/{label:a}_1.csv", r"got {label:a} twice in line 2; write \* for one of them"),
        ("{group:trial}.csv", r"got 'group:trial' in line 2; call it group:trial_number, or"),
        ("{ Group: recording }.csv", r"got 'group:recording' in line 2; call it group:recording_n"),
    ],
)
def test_what_is_no_pattern_is_one_plain_line(cell, words):
    with pytest.raises(BadTable, match=words):
        pattern_of(cell, "line 2")
