"""A blend is as sure as it is right, and windows of a trial are joined for what each adds."""

import numpy as np
import pytest

from taxel.training.choose.blending import fit_last, fit_sharpness, losses, softmax
from taxel.training.choose.candidates import discriminant
from taxel.training.choose.fitting import fit_head, head_logits
from taxel.training.choose.joining import fit_joining, join

RNG = np.random.default_rng(0)


def test_a_temperature_brings_logits_back_to_what_they_were():
    logits = RNG.normal(size=(4000, 3)) * 2
    y = np.array([RNG.choice(3, p=row) for row in softmax(logits)])

    assert fit_sharpness(4.0 * logits, y) == pytest.approx(0.25, rel=0.15)


def test_few_trials_without_an_error_do_not_make_a_recogniser_certain():
    logits = np.eye(2)[np.zeros(10, int)] * 30.0

    assert softmax(fit_sharpness(logits, np.zeros(10, np.intp)) * logits)[0, 0] < 0.99


def mean_of_two_that_err_apart() -> tuple[np.ndarray, np.ndarray]:
    """Return logarithms and classes: each member is right four times in five, rarely both wrong."""
    rng = np.random.default_rng(2)
    y = rng.integers(0, 3, 3000)
    found = np.zeros((3000, 3))
    for half in (0, 1):
        wrong = (rng.random(3000) < 0.4) & (np.arange(3000) % 2 == half)
        named = np.where(wrong, (y + 1) % 3, y)
        found += 0.5 * np.where(np.eye(3)[named] > 0, np.where(wrong, 0.5, 0.9)[:, None], 0.05)
    return np.log(found), y


def test_a_blend_is_as_sure_as_it_is_right_where_groups_are_held_out():
    logits, y = mean_of_two_that_err_apart()
    right = (logits.argmax(axis=1) == y).mean()

    last = fit_last(logits, y, 3000, later=False)

    assert softmax(logits).max(axis=1).mean() < right - 0.05
    assert softmax(last * logits).max(axis=1).mean() == pytest.approx(right, abs=0.02)


def test_errors_that_were_made_take_the_place_of_doubt_and_none_leave_it():
    """Of twelve trials one wrong: no more doubt is added; none wrong: as if one might be."""
    y = np.repeat(np.arange(3), 40)
    named = np.where(np.arange(120) % 12 == 0, (y + 1) % 3, y)
    erring, flawless = 3.0 * np.eye(3)[named], 3.0 * np.eye(3)[y]

    assert fit_last(erring, y, 12, later=True) > fit_sharpness(erring, y, 12)
    for later in (True, False):
        sure = softmax(fit_last(flawless, y, 12, later=later) * flawless).max(axis=1).mean()
        assert 0.9 < sure < 0.96


def test_a_winsorised_discriminant_says_no_more_of_what_is_further_away():
    rng = np.random.default_rng(0)
    y = np.arange(200) % 2
    x = rng.normal(size=(200, 5)).astype(np.float32)
    x[:, 0] += 2.0 * y
    plain, cut = (fit_head(discriminant(name, 0.3), x, y, 2) for name in ("means", "all"))
    near, far = x[:20].copy(), x[:20].copy()
    near[:, 1], far[:, 1] = 3.0, 40.0

    assert np.array_equal(head_logits(cut, near), head_logits(cut, far))
    assert not np.allclose(head_logits(plain, near), head_logits(plain, far), atol=0.01)
    assert (head_logits(cut, x).argmax(axis=1) == y).mean() > 0.75


def test_dependent_windows_are_not_multiplied_as_if_each_added_something_new():
    """20 copies of one guess that is right 8 times in 10 are as sure as that one guess."""
    truth = np.arange(400) % 2
    guess = np.where(np.random.default_rng(1).random(400) < 0.8, truth, 1 - truth)
    unit = np.repeat(np.arange(400), 20)
    windows = np.where(np.eye(2)[guess] > 0, 0.8, 0.2)[unit]

    _, found = join(fit_joining(unit, windows, truth[unit]), unit, windows)

    assert found.max(axis=1).mean() == pytest.approx(0.8, abs=0.05)
    assert losses(found, truth).mean() < 0.55
