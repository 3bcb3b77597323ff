"""What an adapted run was before: its versions, and what each adapting gave.

Knows nothing about how a run is adapted, or where its versions are kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from taxel.bundles.versions import OF_ALL, Change, History, Version
from taxel.views.report.page import Html, join, percent, split_name, table, tag


@dataclass(frozen=True, slots=True)
class Adapted:
    """A run's history and what its versions were found to be worth."""

    history: History
    accuracy: Mapping[int, Mapping[str, float]]
    """Version, if it was cross-validated → split → accuracy, 0…1."""

    @property
    def now(self) -> Version:
        """The version in use."""
        return self.history.version(self.history.current)


def versions_part(adapted: Adapted) -> Html:
    """Return all versions, oldest first, with accuracies before and after."""
    history = adapted.history
    numbers = {version.digest: version.number for version in reversed(history.versions)}
    rows: list[list[object]] = [
        [
            f"{version.number}" + (", in use" if version.number == history.current else ""),
            version.made[:16].replace("T", " ") or "–",
            numbers.get(version.parent, "–"),
            join(
                [join([split_name(split), f": {percent(value)}"])
                 for split, value in adapted.accuracy.get(version.number, {}).items()], "; ",
            ) or "–",
            _points(version.change, OF_ALL) or "–",
            join([Html('<span class="said">'), _change_line(version.change), Html("</span>")]),
        ]
        for version in history.versions
    ]  # fmt: skip
    return join(
        [
            tag(
                "p",
                "Adapting changes the network, so that the cross-validation of the version before "
                "does not hold for it. Before → after: windows that taxel adapt was given with "
                "--test, predicted by the version it came from and by the new one; without --test "
                "the grasps that the run keeps for rehearsal, which gives too high an accuracy.",
            ),
            table(
                ["version", "made", "from", "cross-validated", "before → after",
                 "what was done, and each class"],
                rows,
                kind="findings",
            ),
        ]
    )  # fmt: skip


def _change_line(change: Change) -> str:
    each = [f"{name} {_points(change, name)}" for name in change.after if name != OF_ALL]
    data = f", from {', '.join(change.data)}" if change.data else ""
    return f"{change.what}{data}" + (f": {'; '.join(each)}" if each else "")


def _points(change: Change, what: str) -> str:
    if what not in change.after:
        return ""
    return f"{percent(change.before.get(what))} → {percent(change.after[what])}"
