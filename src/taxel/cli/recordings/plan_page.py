"""Where `taxel record --plan` shows the next trial: the terminal, and a page where asked for."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

from taxel.cli.options.page_address import parse_address

if TYPE_CHECKING:
    from taxel.views.page.plan_link import PlanLink

KEY_OF_STEP = {"ready": "", "again": "r", "discard": "d"}
"""Step of the page → the key that means the same."""


@dataclass(frozen=True, slots=True)
class PlanDisplay:
    """Shows how a plan of trials goes on, in the terminal and on the page."""

    line: Callable[..., None]
    """Shows a line in the terminal."""
    board: PlanLink
    """The page, whether anybody looks or not."""

    def phase(self, line: str) -> None:
        """Show how a trial goes: it has settled, or why it waits."""
        self.line(line)
        self.board.show("POUR NOW" if line.startswith("settled") else "HOLD STILL", line)

    def step(self) -> str | None:
        """Return the key of a step that was taken on the page; None without any."""
        return KEY_OF_STEP.get(self.board.next_step())


def open_shower(
    page: str | None,
    stack: ExitStack,
    trials: int,
    show_line: Callable[..., None],
    *,
    asks: bool,
) -> PlanDisplay:
    """Return where a session is shown; serve the page where that was asked for.

    Args:
        page: Where it listens, HOST:PORT; None serves none.
        stack: Ends the server.
        trials: How many the plan has.
        show_line: Shows a line in the terminal.
        asks: True where a person says that they are ready.

    Raises:
        BadInput: The address cannot be listened on.
        MissingExtra: The page's packages are not installed.
    """
    from taxel.views.page.plan_link import PlanLink

    board = PlanLink(trials, asks=asks)
    if page is not None:
        from taxel.views.page.server import PageServer

        server = stack.enter_context(PageServer(board, *parse_address(page)))
        show_line(f"the page: {server.url}")
    return PlanDisplay(show_line, board)
