"""The file of --html: checked before anything is measured, named when it is written."""

from __future__ import annotations

from pathlib import Path

from taxel.cli.printing import say
from taxel.errors import BadInput


def older_page(html: Path | None) -> bool:
    """Return whether a page takes an older one's place.

    Raises:
        BadInput: It cannot be written there.
    """
    if html is None:
        return False
    from taxel.views.report.page import check_page

    if not _may_hold(html.parent):
        raise BadInput("a file for --html", str(html), "name one such as report.html")
    return check_page(html)


def say_page(html: Path | None, older: bool, *, silent: bool) -> None:
    """Name the page that was written, but where JSON is printed."""
    if html is not None and not silent:
        say(f"page with figures: {html}{', replaced' if older else ''}")


def _may_hold(folder: Path) -> bool:
    """Return whether a file can lie there: it is a folder, or could become one."""
    return folder.is_dir() if folder.exists() else _may_hold(folder.parent)
