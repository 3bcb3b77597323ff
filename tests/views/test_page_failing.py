"""A link that cannot be read: the page says so with each push, the log once."""

from typing import Any, cast

import pytest

from taxel.errors import BadRecording
from taxel.views.page.clients import Clients, _Client

GONE = BadRecording("the recording", "a file that was removed", "put it back")


class Link:
    """A station without cameras that may fail."""

    error: Exception | None = None

    def snapshot(self) -> dict[str, Any]:
        if self.error is not None:
            raise self.error
        return {"time_s": 1.0}

    def traces(self, since_s: float) -> dict[str, Any]:
        return {"time_s": 1.0}


def logged(*errors: Exception | None) -> list[str]:
    """Compose a push for each; return what is in it."""
    link, client = Link(), _Client(cast("Any", None))
    pushing = Clients(cast("Any", link))
    found = []
    for error in errors:
        link.error = error
        found.append(pushing._compose(client)[1])
    return found


def test_what_fails_with_each_push_is_logged_once_until_it_changes(
    caplog: pytest.LogCaptureFixture,
):
    """A replay whose file is replaced fails 20 times a second, for as long as a tab is open."""
    pushes = logged(*[GONE] * 50, OSError("x"), OSError("x"), None, OSError("x"))
    assert sum('"failed"' in push for push in pushes) == 53
    assert [record.getMessage() for record in caplog.records] == [
        f"the page cannot be drawn: BadRecording: {GONE}",
        "the page cannot be drawn: OSError: x",
        "the page cannot be drawn: OSError: x",
    ]


def test_only_an_error_that_nobody_foresaw_is_logged_with_its_trace(
    caplog: pytest.LogCaptureFixture,
):
    logged(GONE, ValueError("x"))
    assert [bool(record.exc_info and record.exc_info[0]) for record in caplog.records] == [
        False, True,
    ]  # fmt: skip
