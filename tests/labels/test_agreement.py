"""Agreement of rules, on cases that can be counted by hand."""

import json

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.labels.agreement import agreement, cohens_kappa, onset_s

TIME = np.arange(10) / 10


def from_frame(onset: int) -> np.ndarray:
    return (np.arange(10) >= onset).astype(np.int8)


def test_the_onset_is_the_first_unstable_moment() -> None:
    assert onset_s(from_frame(4), TIME) == pytest.approx(0.4)
    assert onset_s(from_frame(10), TIME) is None


def test_kappa_in_closed_form() -> None:
    """5 and 7 of 10 unstable, 8 equal: chance is 0.5, so kappa is (0.8 − 0.5) / 0.5."""
    assert cohens_kappa(from_frame(5), from_frame(3)) == pytest.approx(0.6)
    assert cohens_kappa(from_frame(5), from_frame(5)) == 1.0
    assert np.isnan(cohens_kappa(from_frame(10), from_frame(10)))


def test_pairs_of_rules_over_runs() -> None:
    rows = agreement(
        {
            "change": [from_frame(2), from_frame(3), from_frame(5)],
            "slip": [from_frame(6), from_frame(5), from_frame(10)],
        },
        [TIME, TIME + 100, TIME],
    )

    assert len(rows) == 1
    assert (rows[0].first, rows[0].second, rows[0].frames) == ("change", "slip", 30)
    assert rows[0].equal == pytest.approx((6 + 8 + 5) / 30)
    assert (rows[0].runs_both, rows[0].runs_first_only, rows[0].runs_second_only) == (2, 1, 0)
    assert rows[0].lead_s == pytest.approx(0.3)
    assert rows[0].first_earlier == 1.0


def test_nothing_to_compare_is_none_in_json() -> None:
    rows = agreement({"a": [from_frame(10)], "b": [from_frame(10)]}, [TIME])

    assert rows[0].as_dict()["lead_s"] is None
    assert "NaN" not in json.dumps(rows[0].as_dict())


def test_rules_must_label_the_same_frames() -> None:
    with pytest.raises(BadInput, match="same frames"):
        agreement({"a": [from_frame(1)], "b": [from_frame(1)[:5]]}, [TIME])
