"""A stopped page is compared with a running one in neighbouring spells."""

from __future__ import annotations

import pytest

from taxel.bench.faults.quiet_station import paired_ratios


def test_a_drift_is_no_cost_of_the_page():
    """Figures that rise by 1 % a spell, whatever the page does."""
    over, alike = paired_ratios([1.01**spell for spell in range(16)])
    assert len(over) == 8
    assert sorted(over)[3] < 1.0 < sorted(over)[4]
    assert alike == pytest.approx([1.01] * 7)


def test_a_cost_of_the_page_is_seen_whole():
    over, alike = paired_ratios([10.0, 12.0, 12.0, 10.0] * 4)
    assert over == pytest.approx([1.2] * 8)
    assert alike == pytest.approx([1.0] * 7)
