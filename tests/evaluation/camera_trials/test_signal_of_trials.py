"""Claims about how the slip signal alone ranks trials."""

import numpy as np
import pytest

from taxel.evaluation.camera_trials.slip_signal import chosen_on, score_ranks, signal_of
from taxel.gel.slip_signal import TURN_MM
from taxel.windows.trial_crops import MOVES

RATE_HZ = np.array([25.0])
OURS, RATIO, MOST, FURTHEST = (
    "slip rate over gel rate, and largest rate", "slip rate over gel rate", "largest rate",
    "largest slip",
)  # fmt: skip


def crop(**rates: float) -> np.ndarray:
    """Return one camera's crop of 48 frames in which columns grow evenly, by so much a second."""
    shown = np.zeros((1, 48, 1, len(MOVES)), np.float32)
    for name, rate in rates.items():
        shown[0, :, 0, MOVES.index(name)] = rate * np.arange(48) / 25.0
    return shown


def test_an_even_slide_gives_its_own_rates():
    """Gel at 0.3 mm/s across and 0.4 down is 0.5 mm/s; the object slips at 1 mm/s over it."""
    found = signal_of(
        crop(gel_x_mm=0.3, gel_y_mm=0.4, object_x_mm=0.3 + 0.6, object_y_mm=0.4 + 0.8), RATE_HZ
    )
    assert found[RATIO][0] == pytest.approx(np.log(1.05 / 0.55), abs=1e-5)
    assert found[MOST][0] == pytest.approx(np.log(1.05), abs=1e-5)
    assert found[FURTHEST][0] == pytest.approx(47 / 25, abs=1e-5)
    assert found[OURS][0] == pytest.approx(np.log(1.05 / 0.55) + 0.25 * np.log(1.05), abs=1e-5)


def test_a_turn_counts_at_the_levers_length():
    turned, shifted = crop(object_turn=0.2), crop(object_y_mm=0.2 * TURN_MM)
    assert signal_of(turned, RATE_HZ)[OURS] == pytest.approx(signal_of(shifted, RATE_HZ)[OURS])


def test_slip_to_and_fro_is_seen_where_the_distance_alone_would_stand_still():
    """An object that circles at one distance slips all the time."""
    angle = np.linspace(0, 4 * np.pi, 48)
    shown = crop()
    shown[0, :, 0, 0], shown[0, :, 0, 1] = 0.2 * np.cos(angle), 0.2 * np.sin(angle)
    assert signal_of(shown, RATE_HZ)[RATIO][0] > np.log((0.5 + 0.05) / 0.05)


def test_half_of_the_objects_are_left_for_the_figure_whatever_the_order_of_trials():
    objects = np.array(["cup", "ball", "apple", "ball", "dice"])
    assert chosen_on(objects).tolist() == [True, False, True, False, False]
    assert chosen_on(objects[::-1]).tolist() == [False, False, True, False, True]


def test_equal_values_count_half_whatever_the_order_of_trials():
    """Of six pairs one is in order, two are not, and three are equal."""
    values, y = np.array([3.0, 1.0, 3.0, 1.0, 3.0]), np.array([1, 1, 0, 0, 0])
    objects = np.array(["cup", "ball", "cup", "ball", "dice"])
    orders = [np.arange(5), np.arange(5)[::-1], np.argsort(y), np.argsort(-y)]
    found = [score_ranks(values[order], y[order], objects[order]).auc for order in orders]
    want = np.mean([(a > b) + (a == b) / 2 for a in values[y == 1] for b in values[y == 0]])
    assert found == [pytest.approx(want)] * 4
