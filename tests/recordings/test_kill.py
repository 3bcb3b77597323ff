"""A killed recorder loses at most 0.1 s: claimed on real processes and a real kill -9."""

import pytest

from taxel.bench.teng.kill_recorder import kill_often

LARGEST_LOSS_S = 0.1


@pytest.mark.slow
@pytest.mark.data
def test_kill_minus_nine_loses_at_most_a_tenth_of_a_second(tmp_path):
    """Twenty kills at seeded random moments; all that survives is whole and in order."""
    assert max(kill_often(tmp_path, 20)) <= LARGEST_LOSS_S
