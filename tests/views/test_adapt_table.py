"""What a table of an adaptation warns of."""

import pytest
from rich.console import Console

from taxel.bundles.versions import OF_ALL, Change
from taxel.views.tables.adapt import before_after_table


@pytest.mark.parametrize(
    ("after", "named"), [(0.75, None), (0.0, "warning: fell by more than 10 points: rectangle;")]
)
def test_a_known_class_that_falls_far_is_named(after: float, named: str | None):
    before = {OF_ALL: 0.95, "rectangle": 0.8, "sphere": 0.9}
    change = Change(
        what="new class 'prism'", before=before,
        after={OF_ALL: 0.9, "rectangle": after, "sphere": 1.0},
    )  # fmt: skip
    console = Console(width=200, record=True)
    console.print(before_after_table(change, "today.mcap"))
    printed = " ".join(console.export_text().split())
    assert (named in printed) if named else ("warning" not in printed)
