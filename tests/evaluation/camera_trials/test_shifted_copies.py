"""Copies of crops as a camera that sits a little differently would have shown them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from trial_makers import few_small_members, write_trials

from taxel.evaluation.camera_trials.other_sessions import others_to_come
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.trial_set import LabelledTrials, Sight, load_trial_set
from taxel.training.camera_trials.blend import TrialBlend, fit_blend
from taxel.training.camera_trials.learning import Extras, Learning, Moved
from taxel.training.camera_trials.members import MEMBERS, TrialMember
from taxel.training.camera_trials.rank_sums import Steady
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_crops import MOVEMENT, Scene, look_at
from taxel.windows.trial_layout import Layout, count_shifted
from taxel.windows.trial_network import FEATURES
from taxel.windows.trial_shifts import ASKED, SHIFT, looked_at, shifted, stills_of

Image = NDArray[np.uint8]


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    few_small_members(monkeypatch)


def _dot(at: tuple[int, int]) -> Image:
    image = np.zeros((60, 80, 3), np.uint8)
    image[at[0] - 2 : at[0] + 3, at[1] - 2 : at[1] + 3] = 255
    return image


def _centre(image: Image) -> NDArray[np.float64]:
    rows, columns = np.nonzero(image[:, :, 0] > 100)
    return np.array([rows.mean(), columns.mean()])


def test_all_images_of_a_crop_move_alike_and_a_seed_gives_the_same_again() -> None:
    first, second = _dot((30, 40)), _dot((30, 44))
    moved = shifted([first, second, first], (1, 2))
    assert np.array_equal(moved[0], moved[2])
    apart = _centre(moved[1]) - _centre(moved[0])
    assert np.linalg.norm(apart - [0.0, 4.0]) < 0.7  # a pixel each way, and turned by degrees
    again = shifted([first, second, first], (1, 2))
    assert all(np.array_equal(a, b) for a, b in zip(moved, again, strict=True))
    assert not np.array_equal(moved[0], shifted([first], (1, 3))[0])


def test_shifts_are_about_as_large_as_stated() -> None:
    from_centre = np.array(
        [_centre(shifted([_dot((30, 40))], (seed,))[0]) - [30.0, 40.0] for seed in range(200)]
    )
    spread = from_centre.std(axis=0) / 80
    assert np.all((spread > 0.8 * SHIFT) & (spread < 1.25 * SHIFT))


@pytest.mark.parametrize("count", [1, 3, 8, 20])
def test_stills_are_the_first_the_middle_and_the_last_as_views_look_at_them(count: int) -> None:
    images = [np.full((4, 4, 3), at, np.uint8) for at in range(count)]
    held = [*images, *[images[-1]] * (8 - count)]
    found = stills_of(images)
    last = len(held) - 1
    assert len(found) == 8
    for place, at in ((0, 0), (3, last // 2), (7, last)):
        assert np.array_equal(found[place], held[at])


@pytest.mark.parametrize("count", [1, 3, 8, 20, 48])
def test_copies_are_what_views_see_when_all_images_of_a_crop_move(count: int) -> None:
    rng = np.random.default_rng(count)
    images = [rng.integers(0, 256, (30, 40, 3)).astype(np.uint8) for _ in range(count)]

    def network(given: Image) -> NDArray[np.float32]:
        return np.tile(given.mean(axis=(1, 2, 3))[:, None], FEATURES).astype(np.float32)

    for name in ASKED:
        few, every = (
            look_at((name,), [Scene(shifted(own, (1, 2)), 25.0, 0.065, network)])[name]
            for own in (looked_at(name, images), images)
        )
        assert np.array_equal(few, every)
        assert len({id(image) for image in looked_at(name, images)}) <= 8


def test_every_member_but_of_movement_is_compared_on_copies_of_all_that_it_sees() -> None:
    """Else a camera that sits as it did would flatter what looks at whole images."""
    for member in MEMBERS:
        if not set(member.views) <= set(MOVEMENT):
            assert set(member.views) <= {*ASKED, *MOVEMENT}


def test_a_model_sees_moved_columns_of_the_copy_and_the_others_of_its_crop() -> None:
    rows = np.arange(12, dtype=np.float32).reshape(3, 4)
    moved = Moved(np.array([[90, 91], [92, 93]], np.float32), np.array([0, 2]), np.array([1, 3]))
    seen = moved.copies(rows, np.array([3, 0, 1]))
    assert seen.tolist() == [[91, 0, 90], [93, 8, 92]]


def test_copies_stay_with_their_trials_side() -> None:
    moved = Moved(
        np.arange(8, dtype=np.float32)[:, None], np.repeat(np.arange(4), 2), np.array([0])
    )
    learning = Learning(
        np.zeros((4, 1), np.float32), np.arange(4), np.array([0, 1, 0, 1]),
        np.array(list("abcd")), 2, Extras(moved=moved, asked=moved),
    )  # fmt: skip
    part = learning.part(np.array([1, 3]))
    for own in (part.extras.moved, part.extras.asked):
        assert own is not None
        assert own.rows[:, 0].tolist() == [2, 3, 6, 7]
        assert own.crop.tolist() == [0, 0, 1, 1]


def test_copies_are_made_of_the_views_they_are_for_and_kept(tmp_path: Path) -> None:
    trials = read_camera_trials(write_trials(tmp_path / "a", objects=2, each=2, shorter=4))
    kept, sight = tmp_path / "kept", Sight(views=("pixels", "stills"), extras=True, asked=True)
    found = load_trial_set(trials, "slipped", kept, sight=sight)
    moved, asked = found.extras.moved, found.extras.asked
    assert moved is not None
    assert asked is not None
    start = found.widths["pixels"]
    for own, copies in ((moved, 3), (asked, 1)):
        assert own.columns.tolist() == list(range(start, start + found.widths["stills"]))
        assert own.crop.tolist() == np.repeat(np.arange(len(found.rows)), copies).tolist()
        original = found.rows[own.crop][:, own.columns]
        assert np.abs(own.rows - original).max() > 1.0
        assert np.corrcoef(own.rows.ravel(), original.ravel())[0, 1] > 0.8
    again = load_trial_set(trials, "slipped", kept, sight=sight).extras.moved
    assert again is not None
    assert np.array_equal(again.rows, moved.rows)
    assert load_trial_set(trials, "slipped", kept).extras == Extras()


def test_a_large_set_has_fewer_copies() -> None:
    assert [count_shifted(Layout(8, 3), trials) for trials in (100, 400, 1001)] == [3, 2, 0]


def _blend(
    rows: NDArray[np.float64],
    copies: NDArray[np.float64],
    asked: NDArray[np.float64],
    y: NDArray[np.intp],
) -> TrialBlend:
    """Return a blend of one session: of a member on two columns that shift, and of another."""
    moved, compared = (
        Moved(own.astype(np.float32), np.arange(len(y)), np.arange(2)) for own in (copies, asked)
    )
    learning = Learning(
        rows.astype(np.float32), np.arange(len(y)), y, np.full(len(y), "day"), 2,
        Extras(moved=moved, asked=compared),
    )  # fmt: skip
    members = [
        TrialMember(name=name, views={view: ()}, make=lambda s, t, w: Steady(0.5), shifted=shifts)
        for name, view, shifts in (("place", "picture", True), ("other", "network", False))
    ]
    return fit_blend(learning, 1, {"picture": 2, "network": 1}, 0, members)


def test_inner_folds_decide_whether_a_member_learns_from_copies() -> None:
    """Copies whose classes have changed places mislead; copies that are alike do not."""
    rng = np.random.default_rng(0)
    y = np.arange(60) % 2
    rows = np.column_stack([rng.normal(size=(60, 2)) + 2.0 * y[:, None], rng.normal(size=60)])
    alike, exchanged = rows[:, :2] + rng.normal(0, 0.2, (60, 2)), rows[np.arange(60) ^ 1, :2]
    (good, *_), (bad, *_) = (_blend(rows, own, alike, y).members for own in (alike, exchanged))
    assert good.name == bad.name == "place"
    assert (good.shifted, good.words) == (True, "place with shifted copies")
    assert (bad.shifted, bad.words) == (False, "place")


def test_what_fails_on_shifted_copies_counts_less_where_sessions_cannot_be_held_out() -> None:
    """By single trials of one session it would be ahead."""
    rng = np.random.default_rng(1)
    y = np.arange(60) % 2
    place = np.tile(3.0 * y[:, None], 2) + rng.normal(0, 0.3, (60, 2))
    rows = np.column_stack([place, 2.0 * y + rng.normal(size=60)])
    elsewhere = rng.normal(1.5, 2.0, (60, 2))
    as_it_was, shifted_too = (_blend(rows, place, own, y) for own in (place, elsewhere))
    assert as_it_was.inner["place"] < as_it_was.inner["other"]
    assert shifted_too.inner["place"] > shifted_too.inner["other"]


def _trials(
    y: Sequence[int], sessions: Sequence[str] | None, **more: Sequence[str]
) -> LabelledTrials:
    named = {**({} if sessions is None else {"session": sessions}), **more}
    groups = tuple({key: own[at] for key, own in named.items()} for at in range(len(y)))
    names = tuple(f"t{at}" for at in range(len(y)))
    return LabelledTrials(
        target="x", classes=("a", "b"), y=np.array(y, np.intp), names=names, groups=groups
    )


@pytest.mark.parametrize(
    ("sessions", "split", "others"),
    [
        ("aabbccddaabbccdd", None, False),  # whole sessions are held out inside, too
        ("aaaaaaaabbbbbbbb", None, True),  # each side learns from one session
        ("aaaaaaaaaaaaaaaa", "random", False),  # single trials are tested
        (None, None, False),
        (None, "split", True),  # test trials are given, and nothing says of which session
    ],
)
def test_where_sessions_are_to_come_that_inner_folds_cannot_hold_out(
    sessions: str | None, split: str | None, others: bool
) -> None:
    more = {"split": ["train", "train", "train", "test"] * 4} if split == "split" else {}
    trials = _trials([0, 1] * 8 if not more else [0, 0, 1, 1, 1, 1, 0, 0] * 2, sessions, **more)
    parted = split_trials(trials.groups, trials.y, split, 2, 0, trials.classes)
    assert others_to_come(trials, parted, 0) is others


def test_where_each_class_is_an_object_its_trials_are_what_is_to_come() -> None:
    trials = _trials([0] * 8 + [1] * 8, None, object=["cup"] * 8 + ["ball"] * 8,
                     split=["train", "test"] * 8)  # fmt: skip
    parted = split_trials(trials.groups, trials.y, None, 2, 0, trials.classes)
    assert not others_to_come(trials, parted, 0)


def test_where_nothing_can_be_held_out_members_learn_from_copies() -> None:
    rows = np.array([[0, 0, 0], [3, 3, 3]], np.float64)
    blend = _blend(rows, rows[:, :2], rows[:, :2], np.arange(2))
    assert blend.inner == {}
    assert [member.shifted for member in blend.members] == [True, False]
