"""The file of --html: checked before anything is measured, named when it is written."""

from __future__ import annotations

from pathlib import Path

from taxel.cli.printing import say


def older_page(html: Path | None) -> bool:
    """Return whether a page takes an older one's place.

    Raises:
        BadInput: It cannot be written there.
    """
    if html is None:
        return False
    from taxel.recordings.whole import check_place
    from taxel.views.report.page import check_page

    older = check_page(html)
    check_place(html)
    return older


def say_page(html: Path | None, older: bool, *, silent: bool) -> None:
    """Name the page that was written, but where JSON is printed."""
    if html is not None and not silent:
        say(f"page with figures: {html}{', replaced' if older else ''}")
