"""Where a page listens: as it is typed behind `--page`, or this machine alone at a free port."""

import pytest

from taxel.cli.page_address import page_address
from taxel.errors import BadInput


@pytest.mark.parametrize(
    ("typed", "place"),
    [
        (None, ("127.0.0.1", 0)),
        ((), ("127.0.0.1", 0)),
        (("0.0.0.0:8080",), ("0.0.0.0", 8080)),
        (("[::1]:0",), ("::1", 0)),
    ],
)
def test_a_page_listens_where_it_is_told(
    typed: tuple[str, ...] | None, place: tuple[str, int]
) -> None:
    assert page_address(typed) == place


@pytest.mark.parametrize(
    ("typed", "got"),
    [
        (("cup-pour", "sim://cup-pour"), "got cup-pour sim://cup-pour; put --page last"),
        (("8080",), "needed HOST:PORT for --page; got '8080'"),
        (("127.0.0.1:99999",), "needed HOST:PORT for --page"),
    ],
)
def test_what_is_no_place_is_refused_in_one_line(typed: tuple[str, ...], got: str) -> None:
    with pytest.raises(BadInput) as refused:
        page_address(typed)

    assert got in str(refused.value)
