"""The site's pages: nothing is left out of the navigation, links and pictures lead somewhere."""

import re
from pathlib import Path

import pytest
from website.api_pages import api_pages, constants_table
from website.check_site import defined_names, public_names
from website.cli_pages import cli_pages
from website.places import page_of, title_and_lead, turn_links
from website.sections import JOBS, listing

from taxel.cli.main import VERBS

ROOT = Path(__file__).parents[2]


def test_a_link_leads_to_where_the_site_has_the_file():
    text = "[a](../examples/01_view_touch.py) ![p](pictures/x.png) [c](https://e.org) [h](#top)"
    turned = turn_links(text, "docs/tutorial.md", "tutorial.md")

    assert (
        turned == "[a](examples/01_view_touch.md) ![p](pictures/x.png) [c](https://e.org) [h](#top)"
    )
    assert turn_links("[d](docs/decisions/)", "README.md", "index.md") == "[d](decisions/index.md)"
    assert turn_links("[e](evidence/)", "docs/decisions/0001.md", "decisions/0001.md") == (
        "[e](evidence/index.md)"
    )
    assert turn_links("[c](../../src/taxel/clock.py)", "docs/how-to/a.md", "how-to/a.md") == (
        "[c](../reference/api/taxel/clock.md)"
    )


def test_code_is_left_alone_and_a_file_without_a_page_keeps_its_link():
    """The strict build then refuses it."""
    assert turn_links("```sh\n[x](../README.md)\n```", "docs/a.md", "a.md").count("README.md") == 1
    assert turn_links("[x](../Makefile)", "docs/a.md", "a.md") == "[x](../Makefile)"
    assert page_of("Makefile") is None


def test_the_strict_build_is_not_silenced():
    """MkDocs counts the warnings that it prints: with --quiet a broken link passed."""
    build = re.search(r"mkdocs build .*", (ROOT / "Makefile").read_text("utf-8"))

    assert build is not None
    assert "--strict" in build[0]
    assert "--quiet" not in build[0]


def test_every_written_page_has_a_heading():
    for path in (ROOT / "docs").rglob("*.md"):
        assert title_and_lead(path.read_text("utf-8"))[0], path


def test_the_page_of_how_tos_has_each_of_them_once_under_the_heading_of_its_job():
    page = listing("how-to", "How to", {})
    links = re.findall(r"^\| \[[^\]]+\]\(([\w-]+)\.md\)", page, re.M)

    assert links == [name for names in JOBS.values() for name in names]
    assert sorted(links) == sorted(path.stem for path in (ROOT / "docs/how-to").glob("*.md"))
    assert re.findall(r"^## (.+)$", page, re.M) == list(JOBS)


def test_each_page_of_evidence_and_its_decision_link_to_each_other():
    decisions = ROOT / "docs/decisions"
    listed = (decisions / "evidence/index.md").read_text("utf-8")
    for path in sorted((decisions / "evidence").glob("[0-9]*.md")):
        (decision,) = decisions.glob(f"{path.name[:4]}-*.md")

        assert f"](evidence/{path.name})" in decision.read_text("utf-8")
        assert f"](../{decision.name}" in path.read_text("utf-8")
        assert f"]({path.name})" in listed


@pytest.mark.slow
def test_every_public_module_has_a_page_and_every_verb():
    pages = api_pages()
    for name in public_names():
        if (ROOT / "src" / (name.replace(".", "/") + ".py")).exists():
            assert f"reference/api/{name.replace('.', '/')}.md" in pages
    assert {f"reference/cli/{verb}.md" for verb in VERBS} <= set(cli_pages())


def test_an_option_stands_with_its_type_its_meaning_and_its_default():
    page = cli_pages()["reference/cli/demo.md"]

    assert "| `--live-seconds FLOAT` | Seconds of live prediction" in page
    assert re.search(r"--live-seconds.*\| `60\.0` \|", page)


def test_public_names_are_those_without_an_underscore():
    text = "A = 1\n_B = 2\ndef f(): ...\nclass C:\n    x: int\n    def g(self): ...\n"

    assert list(defined_names(text, "m")) == ["m.A", "m.f", "m.C.x", "m.C.g", "m.C"]


def test_a_table_of_constants_holds_values_and_sources():
    table = constants_table("taxel.sim.teng.constants")

    assert "| `HUM_HZ` | `50.0` |  |" in table
    assert "| `BITS` | `10` | Source: ATmega2560 datasheet. |" in table


@pytest.mark.parametrize("path", sorted((ROOT / "docs/pictures").iterdir()), ids=lambda p: p.name)
def test_every_picture_stands_in_the_gallery_below_the_command_that_makes_it(path):
    gallery = (ROOT / "docs/gallery.md").read_text("utf-8")
    section = next(part for part in gallery.split("\n## ") if f"(pictures/{path.name})" in part)

    assert re.search(r"^```(sh|bash)\n.+?^```", section, re.M | re.S) or "by hand" in section


def test_every_path_of_the_source_that_a_page_names_exists():
    wrong = []
    for page in [
        ROOT / "CONTRIBUTING.md",
        *(ROOT / "docs").glob("*/*.md"),
        *(ROOT / "docs").glob("*.md"),
    ]:
        if page.parent.name == "decisions":  # a decision speaks of its own day
            continue
        for path in re.findall(r"`((?:src/taxel|tests|examples|firmware|website)/[\w/.-]+)`",
                               page.read_text("utf-8")):  # fmt: skip
            if not (ROOT / path).exists() and "/build/" not in path:
                wrong.append(f"{page.relative_to(ROOT)}: {path}")

    assert wrong == []
