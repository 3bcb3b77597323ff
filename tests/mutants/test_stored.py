"""The stored figures of mutants and branches hold what is promised, and are those of the page."""

import ast
import json
from importlib.util import find_spec
from typing import Any

import pytest
from mutants.places import GOAL, PLACES, ROOT, STORED, key_of
from mutants.stored import explained, page

FOUND: dict[str, Any] = json.loads(STORED.read_text())


@pytest.mark.parametrize("name", PLACES)
def test_at_least_100_mutants_of_each_place_were_tried_and_enough_were_killed(name: str) -> None:
    row = FOUND["mutants"][name]

    assert row["mutants"] >= 100
    assert row["survived"] == len(row["survivors"])
    assert row["score"] == pytest.approx(1 - row["survived"] / row["mutants"], abs=1e-4)
    assert row["score"] >= GOAL


def test_every_survivor_is_explained_by_a_line_that_is_still_there() -> None:
    known = {(row["file"], row["before"], row["after"]) for row in explained()}
    survivors = {
        (row["file"], row["before"], row["after"])
        for place in FOUND["mutants"].values()
        for row in place["survivors"]
    }
    assert survivors <= known
    for file, before, _ in known:
        assert before.splitlines()[0] in (ROOT / file).read_text(), file


def test_the_page_shows_the_stored_figures() -> None:
    assert (ROOT / "docs/reference/tests.md").read_text() == page(FOUND)


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_a_place_s_files_and_tests_are_there_and_its_nearest_tests_come_first(place) -> None:
    files, tests = place.files(), place.test_files()

    assert files
    assert all(file.is_file() for file in [*files, *tests])
    for source in files:
        names = place.tests_for(source)
        assert sorted(names) == sorted(str(file.relative_to(ROOT)) for file in tests)
        near = [f"test_{source.stem}" in name for name in names]
        assert near == sorted(near, reverse=True)


def test_a_mutant_is_named_by_its_file_and_all_of_its_source() -> None:
    mutant = {"file": "a.py", "source": "x = 1"}

    assert key_of(mutant) == key_of(dict(mutant))
    assert (
        len({key_of(mutant), key_of(mutant | {"file": "b.py"}), key_of(mutant | {"source": "x"})})
        == 3
    )


@pytest.mark.skipif(find_spec("cosmic_ray") is None, reason="cosmic-ray: make mutants brings it")
def test_a_seed_draws_the_same_mutants_each_of_which_is_another_program() -> None:
    from mutants.draw import draw

    place = PLACES["splits"]
    drawn = draw(place, 20, seed=1)

    assert drawn == draw(place, 20, seed=1) != draw(place, 20, seed=2)
    assert len({mutant["source"] for mutant in drawn}) == 20
    true = place.files()[0].read_text()
    assert ast.dump(ast.parse(true)) not in {ast.dump(ast.parse(m["source"])) for m in drawn}
