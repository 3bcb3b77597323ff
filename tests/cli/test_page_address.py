"""Where a page listens: as it is typed behind `--page`, or this machine alone at a free port."""

from collections.abc import Callable

import pytest

from taxel.cli.live.live import Live
from taxel.cli.options.page_address import LOCAL_ADDRESS, parse_address, with_addresses
from taxel.cli.parsing import parse

WORDS = ("cup-pour", "sim://cup-pour")


@pytest.mark.parametrize(
    ("typed", "place"),
    [
        ("127.0.0.1:0", ("127.0.0.1", 0)),
        ("0.0.0.0:8080", ("0.0.0.0", 8080)),
        ("[::1]:0", ("::1", 0)),
    ],
)
def test_a_page_listens_where_it_is_told(typed: str, place: tuple[str, int]) -> None:
    assert parse_address(typed) == place


@pytest.mark.parametrize(
    ("line", "page"),
    [
        ("cup-pour sim://cup-pour", None),
        ("cup-pour sim://cup-pour --page", LOCAL_ADDRESS),
        ("--page cup-pour sim://cup-pour", LOCAL_ADDRESS),
        ("cup-pour --page sim://cup-pour", LOCAL_ADDRESS),
        ("cup-pour sim://cup-pour --page --json", LOCAL_ADDRESS),
        ("--page 0.0.0.0:8080 cup-pour sim://cup-pour", "0.0.0.0:8080"),
        ("cup-pour sim://cup-pour --page [::1]:8080", "[::1]:8080"),
        ("--page=lab:8080 cup-pour sim://cup-pour", "lab:8080"),
    ],
)
def test_a_page_may_be_asked_for_anywhere_in_the_line(line: str, page: str | None) -> None:
    """Bundle and source keep their places: an address is told apart from both."""
    live = parse(Live, "live", line.split())
    assert (str(live.bundle), live.source, live.page) == (*WORDS, page)


@pytest.mark.parametrize(
    ("following", "address"),
    [
        ("replay://C:8080", False),
        ("serial:///dev/ttyUSB0", False),
        ("b.taxel", False),
        ("8080", True),
        ("127.0.0.1", True),
        ("lab:99999", True),
        (":", True),
        ("lab:http", True),
        ("127.0.0.1:-1", True),
        ("127.0.0.1:80.5", True),
        ("day:2.taxel", False),
        (r"C:\bundle", False),
        ("D:/bundle", False),
    ],
)
def test_what_is_meant_for_an_address_is_refused_as_one_where_it_is_wrong(
    following: str, address: bool
) -> None:
    inserted = [] if address else [LOCAL_ADDRESS]
    assert with_addresses(["--page", following]) == ["--page", *inserted, following]


@pytest.mark.parametrize("typed", ["8080", "127.0.0.1:99999", "127.0.0.1"])
def test_what_is_no_place_is_refused_in_one_line(
    typed: str, refused: Callable[[list[str]], str]
) -> None:
    message = refused(["live", "--page", typed, *WORDS])
    assert f"needed HOST:PORT for --page; got '{typed}'" in message
