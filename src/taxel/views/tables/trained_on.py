"""The warning beside the score of a bundle on what it was trained on.

Knows nothing about scores or bundles.
"""

from __future__ import annotations

from collections.abc import Sequence

from taxel.plain_text import visible


def trained_on_line(names: Sequence[str], what: str, *, known: bool) -> str | None:
    """Return a warning where a bundle was, or may have been, trained on what it scores.

    Args:
        names: Those of them that it was trained on.
        what: Such as "recordings".
        known: False for an older bundle, which does not say what it was trained on.
    """
    if not known:
        return (
            f"the bundle does not say which {what} it was trained on: make sure that none of these "
            "is among them"
        )
    if not names:
        return None
    if len(names) == 1:
        return f"the bundle was trained on {visible(names[0])}: accuracy on it is not a test"
    return (
        f"the bundle was trained on {len(names)} of these {what} (such as {visible(names[0])}): "
        "accuracy on them is not a test"
    )


def unchecked_line(what: str, error: Exception) -> str:
    """Return a warning where nobody can find out any more what a bundle was trained on.

    Args:
        what: Such as "recordings".
        error: Why not, as where a file was deleted meanwhile.
    """
    got = getattr(error, "got", error)
    return (
        f"whether the bundle was trained on these {what} could not be checked ({visible(str(got))})"
        ": make sure that none of them is among its training data"
    )
