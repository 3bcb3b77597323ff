"""The foot of the TENG hand's pages: how they were made."""

from pathlib import Path

import pytest

from taxel.views.report.teng_pages import _write


def test_a_page_of_a_cross_validation_names_the_command_that_made_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It named --split with a split's title, such as 'random windows (leaks)', which is refused."""
    words = ["evaluate", "my set", "--split", "random", "--html", "page.html"]
    monkeypatch.setattr("sys.argv", ["/usr/bin/taxel", *words])
    _write(tmp_path / "page.html", "taxel: shape", [])
    page = (tmp_path / "page.html").read_text()
    assert "<code>taxel evaluate &#x27;my set&#x27; --split random --html page.html</code>" in page
    monkeypatch.setattr("sys.argv", ["/usr/bin/pytest"])
    _write(tmp_path / "page.html", "taxel: shape", [])
    assert "made from Python, not by a command" in (tmp_path / "page.html").read_text()
