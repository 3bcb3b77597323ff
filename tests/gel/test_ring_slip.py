"""How far rings of a gel go with the object."""

import numpy as np
import pytest

from taxel.gel.ring_slip import RING_FEATURES, RINGS, GelRings, ring_weights

ALL_SEEN = np.ones(len(RINGS), np.bool_)
FAR = np.array(RINGS)
"""A dot in the middle of each ring."""
RIGHT = np.tile([1.0, 0.0], (len(RINGS), 1))


def values(rings: GelRings, what: str) -> np.ndarray:
    return np.array([rings.values[RING_FEATURES.index(f"ring_{what}_{ring:g}")] for ring in RINGS])


def pushed(shares: np.ndarray, steps: int = 20, size_px: float = 10.0) -> GelRings:
    """Return rings after the object has moved to the right in even steps, dots by a share of it."""
    rings = GelRings()
    for step in range(1, steps + 1):
        carried = RIGHT * size_px * step / steps
        rings.push(carried * shares[:, None], carried, FAR, ALL_SEEN)
    return rings


def test_dots_that_go_with_the_object_have_all_of_its_motion_and_lose_nothing():
    rings = pushed(np.ones(len(RINGS)))

    assert values(rings, "share") == pytest.approx(np.ones(len(RINGS)), abs=1e-3)
    assert values(rings, "share_now") == pytest.approx(np.ones(len(RINGS)), abs=1e-3)
    assert values(rings, "share_lost") == pytest.approx(np.zeros(len(RINGS)), abs=1e-3)


def test_a_ring_that_stays_behind_loses_its_share_the_rest_keep_theirs():
    rings = pushed(np.ones(len(RINGS)))
    moved = 10.0 * RIGHT
    for step in range(1, 9):  # from here on the outermost ring stands still
        carried = RIGHT * (10.0 + step)
        moved = np.where(np.arange(len(RINGS))[:, None] < len(RINGS) - 1, carried, moved)
        rings.push(moved, carried, FAR, ALL_SEEN)

    share, now, lost = (values(rings, what) for what in ("share", "share_now", "share_lost"))
    assert share[:-1] == pytest.approx(np.ones(len(RINGS) - 1), abs=1e-3)
    assert share[-1] == pytest.approx(10 / 18, abs=1e-3)
    assert lost[-1] == pytest.approx(10 / 18 - 1, abs=2e-3)
    assert np.abs(lost[:-1]).max() < 1e-3
    assert now[-1] == pytest.approx(0.0, abs=1e-3)
    assert now[:-1] == pytest.approx(np.ones(len(RINGS) - 1), abs=1e-3)


def test_neither_the_size_of_the_motion_nor_its_direction_matters():
    shares = np.linspace(1.0, 0.3, len(RINGS))
    small, large = pushed(shares, size_px=8.0), pushed(shares, size_px=40.0)
    turned = GelRings()
    for step in range(1, 21):
        carried = RIGHT[:, ::-1] * -8.0 * step / 20
        turned.push(carried * shares[:, None], carried, FAR, ALL_SEEN)

    assert small.values == pytest.approx(large.values, abs=5e-3)
    assert small.values == pytest.approx(turned.values)


def test_noise_alone_gives_no_share():
    random, rings = np.random.default_rng(0), GelRings()
    for _ in range(30):
        moved, carried = random.normal(0, 0.03, (2, len(RINGS), 2))
        rings.push(moved, carried, FAR, ALL_SEEN)

    assert np.abs(rings.values).max() < 0.3


def test_a_ring_without_dots_keeps_its_last_values():
    rings = pushed(np.full(len(RINGS), 0.8))
    before = rings.values.copy()
    seen = ALL_SEEN.copy()
    seen[2] = False
    rings.push(np.zeros((len(RINGS), 2)), 11.0 * RIGHT, FAR, seen)

    for what in ("share", "share_now", "share_lost"):
        at = RING_FEATURES.index(f"ring_{what}_{RINGS[2]:g}")
        assert rings.values[at] == before[at]
        assert rings.values[at + 1] != before[at + 1]


def test_a_dot_counts_in_the_two_rings_that_it_lies_between():
    far = np.array([0.0, 0.6, 0.8, 1.0, 2.45, 2.7, 2.95, 3.2, 9.0])
    weights = ring_weights(far)

    assert weights[:, :6].sum(axis=0) == pytest.approx(np.ones(6))
    assert weights[:2, 2] == pytest.approx([0.5, 0.5])
    assert weights[-1, 6:] == pytest.approx([0.5, 0.0, 0.0])
    assert weights[0, 0] == 1.0
