"""What a crop of a camera trial shows, on images whose numbers are known beforehand (0049)."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.windows import trial_crops
from taxel.windows.trial_crops import (
    CHANGES,
    FAMILIES,
    PIXELS,
    SLIP,
    STATISTICS,
    STILLS,
    Scene,
    look_at,
    numbers_of,
    row_of,
)
from taxel.windows.trial_layout import Layout, choose_layout, count_between

PLACES = (3, 4)


def plain(level: float, height: int = 120, width: int = 160) -> np.ndarray:
    return np.full((height, width, 3), level, np.uint8)


def blocks() -> np.ndarray:
    """Twelve places of 40 × 40 pixels, the levels 0, 10, … 110, row by row."""
    return np.kron(10 * np.arange(12).reshape(PLACES), np.ones((40, 40))).astype(np.uint8)


def test_crops_between_lie_evenly_and_their_number_says_nothing_of_the_length():
    """Halves are parted evenly; a trial of just a crop has as many; one place has none."""
    assert Layout(10, 3).between(range(90), 6) == [10, 20, 30, 50, 60, 70]
    assert Layout(10, 3).between(range(90), 2) == [20, 60]
    assert Layout(10, 3).between(range(10), 6) == [0] * 6
    assert Layout(10, 1).between(range(90), 6) == []


def test_the_more_trials_there_are_the_fewer_crops_lie_between():
    """All crops together stay within what is allowed, so that time does."""
    counts = [count_between(Layout(10, 3), trials) for trials in (10, 333, 334, 600, 601)]
    assert counts == [6, 6, 2, 2, 0]
    assert count_between(Layout(10, 3), 1001) == 0, "three crops a trial are too many already"
    assert count_between(Layout(10, 1), 10) == 0


def test_crops_lie_at_the_start_in_the_middle_and_at_the_end():
    assert Layout(10, 3).starts(range(31)) == [0, 10, 21]
    assert Layout(10, 1).starts(range(31)) == [0]
    assert (Layout(10, 3).every, Layout(1, 1).every, Layout(9, 1).every) == (5, 1, 4)


def test_crops_fit_into_the_shortest_trial():
    assert choose_layout([60, 49, 70]) == Layout(48, 3)
    assert choose_layout([47, 60]) == Layout(47, 3)
    assert choose_layout([48, 48]) == Layout(48, 1)
    assert choose_layout([8, 9]) == Layout(8, 3)
    assert choose_layout([20, 30], crop=8) == Layout(8, 3)
    assert choose_layout([20, 20], crop=20) == Layout(20, 1)
    for crop in (7, 21):
        with pytest.raises(BadInput, match="8 to 20 frames"):
            choose_layout([20, 30], crop=crop)
    assert choose_layout([7, 30]) == Layout(7, 3)
    assert choose_layout([1, 1]) == Layout(1, 1)
    with pytest.raises(BadInput, match="3 to 3 frames"):
        choose_layout([3, 30], crop=8)


def test_a_still_is_a_small_grey_image_edges_and_colours_by_place():
    image = np.repeat(blocks()[..., None], 3, axis=2)
    image[..., 2] = 0
    look = trial_crops._look_of(image)
    thumb, edges, colour = np.split(look, [48, 48 + 96])

    assert len(look) == FAMILIES["stills"].columns == 6 * 8 + 3 * 4 * (8 + 3)
    grey = 10 * np.arange(12).reshape(PLACES) * (0.299 + 0.587)
    np.testing.assert_allclose(thumb.reshape(6, 8), np.kron(grey, np.ones((2, 2))), atol=0.6)
    np.testing.assert_allclose(colour.reshape(3, 4, 3)[..., 0].ravel(), 10.0 * np.arange(12))
    assert not colour.reshape(3, 4, 3)[..., 2].any()
    assert edges.shape == (96,)


@pytest.mark.parametrize(("upright", "sector"), [(True, 0), (False, 2)])
def test_an_edge_is_described_by_its_direction_and_its_place(upright: bool, sector: int):
    """A step across the middle of the last place of the first row: its gradient points right, or
    down, a quarter of the way round."""
    grey = np.zeros((120, 160), np.uint8)
    if upright:
        grey[5:35, 140:] = 255
        grey[5:35, 150:] = 0
    else:
        grey[20:, 125:155] = 255
        grey[30:, 125:155] = 0
    edges = trial_crops._edges(grey).reshape(3, 4, 8)
    strongest = np.unravel_index(edges.argmax(), edges.shape)

    assert strongest[:2] == (0, 3)
    assert strongest[2] in (sector * 2, sector * 2 + 4, (sector * 2 + 7) % 8, sector * 2 - 1)
    assert edges[0, 3].sum() == pytest.approx(edges.sum())


@pytest.mark.parametrize("place", range(12))
def test_edges_are_counted_in_their_own_place(place: int):
    row, column = divmod(place, 4)
    grey = np.zeros((120, 160), np.uint8)
    grey[40 * row + 10 : 40 * row + 30, 40 * column + 10 : 40 * column + 30] = 255
    strength = trial_crops._edges(grey).reshape(12, 8).sum(axis=1)

    assert np.flatnonzero(strength).tolist() == [place]


def test_stills_are_the_first_the_middle_and_the_last_frame_and_how_they_differ():
    scene = Scene([plain(10 * n) for n in range(10)], 25.0, 0.065)
    looks = FAMILIES["stills"].look(scene)
    assert looks[:, :48].mean(axis=1).tolist() == [0.0, 40.0, 90.0]
    summed = FAMILIES["stills"].sum_up(np.stack([looks, looks + 5.0], axis=1))
    first, middle, last = np.split(summed, 3, axis=1)
    np.testing.assert_array_equal(first, np.stack([looks[0], looks[0] + 5.0]))
    np.testing.assert_array_equal(middle, np.stack([looks[1] - looks[0]] * 2))
    np.testing.assert_array_equal(last, np.stack([looks[2] - looks[0]] * 2))


def test_differences_are_to_the_frame_before_the_first_and_the_fifth_before():
    levels = [0, 1, 3, 6, 10, 15, 21, 28]
    shown = FAMILIES["pixels"].look(Scene([plain(n) for n in levels], 25.0, 0.065))
    column = {name: shown[:, PIXELS.index(name)].tolist() for name in PIXELS}

    assert column["step"] == column["step_p95"] == column["step_7"] == [0, 1, 2, 3, 4, 5, 6, 7]
    assert column["since"] == column["since_p95"] == column["since_11"] == levels
    assert column["lagged"] == [0, 1, 3, 6, 10, 15, 20, 25]
    assert column["flow"] == [0.0] * 8
    assert shown.shape == (8, len(PIXELS))


def test_places_are_counted_row_by_row():
    np.testing.assert_allclose(trial_crops._by_place(blocks()), 10.0 * np.arange(12))


def test_the_95th_percentile_is_the_level_that_95_of_100_do_not_pass():
    assert trial_crops._p95(np.arange(100).reshape(10, 10)) == 94.0
    assert trial_crops._p95(np.zeros((4, 4))) == 0.0


def test_flow_is_described_as_shift_turn_growth_and_spread():
    """u = 3 + 0.02 x − 0.05 y, v = 4 + 0.07 x + 0.03 y: turn 0.07 + 0.05, growth 0.02 + 0.03."""
    y, x = np.mgrid[-2:3, -3:4].astype(float)
    moved = np.stack([3 + 0.02 * x - 0.05 * y, 4 + 0.07 * x + 0.03 * y], axis=2)
    found = trial_crops._flow_columns(moved.astype(np.float32))
    length = np.hypot(moved[..., 0], moved[..., 1])
    variance = (0.02**2 + 0.07**2) * 4.0 + (0.05**2 + 0.03**2) * 2.0

    np.testing.assert_allclose(
        found, [3.0, 4.0, length.mean(), np.percentile(length, 90), np.sqrt(variance), 0.12, 0.05],
        rtol=1e-5,
    )  # fmt: skip


@pytest.mark.parametrize(("cycles", "band"), [(0, None), (1, 0), (2, 0), (3, 1), (7, 1), (8, 2)])
def test_a_course_is_summed_up_in_twelve_numbers(cycles: int, band: int | None):
    """Steps of a wave with so many cycles a crop; its power is in one band alone."""
    steps = np.cos(2 * np.pi * cycles * np.arange(16) / 16)
    values = np.concatenate([[5.0], 5.0 + np.cumsum(steps)])[:, None, None].astype(np.float32)
    found = trial_crops._courses(values)[0]
    course = values[:, 0, 0]

    assert found.shape == (STATISTICS,) == (12,)
    np.testing.assert_allclose(found[:5], [
        course.mean(), course.std(), course.min(), course.max(), course[-1],
    ], rtol=1e-5)  # fmt: skip
    np.testing.assert_allclose(found[5:8], np.percentile(course, (10, 50, 90)), rtol=1e-5)
    assert found[8] == pytest.approx((steps**2).mean(), rel=1e-4)
    power = [0.0, 0.0, 0.0]
    if band is not None:
        power[band] = np.log1p(16.0 if cycles == 8 else 4.0)
    np.testing.assert_allclose(found[9:], power, atol=1e-4)


def test_of_two_cameras_the_largest_and_the_least_of_each_number_are_kept():
    rng = np.random.default_rng(0)
    one, two = rng.normal(size=(2, 3, FAMILIES["stills"].columns)).astype(np.float32)
    both = row_of({"stills": np.stack([one, two], axis=1)})["stills"]
    alone = [row_of({"stills": own[:, None]})["stills"] for own in (one, two)]

    np.testing.assert_array_equal(both, np.concatenate([np.maximum(*alone), np.minimum(*alone)]))


def test_what_is_no_number_becomes_0_or_a_million():
    values = np.zeros((3, 1, FAMILIES["stills"].columns), np.float32)
    values[0, 0, :5] = [np.nan, np.inf, -np.inf, 2e6, -2e6]
    found = row_of({"stills": values})["stills"]

    assert found[:5].tolist() == [0.0, 1e6, -1e6, 1e6, -1e6]
    assert found.dtype == np.float32


@pytest.mark.parametrize("cameras", [1, 2])
def test_columns_are_found_again_among_the_numbers(cameras: int):
    columns = np.arange(len(SLIP), dtype=np.float32)
    values = np.repeat(np.repeat(columns[None, None], 9, axis=0), cameras, axis=1)
    row = row_of({"slip": values})["slip"]
    chosen = row[numbers_of("slip", ["slip_seen", "slip_mm"], cameras)]

    assert len(chosen) == 12 * 2 * (2 if cameras > 1 else 1)
    assert chosen[:4].tolist() == [2.0, 0.0, 0.0, 0.0]  # two means, then two deviations


@pytest.mark.parametrize("cameras", [1, 2])
def test_changes_are_what_the_thumbs_have_gained_since_the_first_frame(cameras: int):
    shown = np.random.default_rng(2).normal(size=(3, cameras, STILLS)).astype(np.float32)
    row = row_of({"stills": shown})["stills"]
    found = row[numbers_of("stills", CHANGES, cameras)].reshape(-1, 2, 48)
    gained = np.stack([shown[at, :, :48] - shown[0, :, :48] for at in (1, 2)])
    expected = [gained.max(axis=1), gained.min(axis=1)] if cameras == 2 else [gained[:, 0]]
    assert np.array_equal(found, expected)


def test_poses_are_measured_in_millimetres_and_seconds(monkeypatch: pytest.MonkeyPatch):
    pushed = []

    class Gel:
        slip = SimpleNamespace(distance_mm=1.5, rate_mm_s=2.5, seen=True)
        features = (0.0,) * (len(SLIP) - 3)

        def push(self, *given: object) -> None:
            pushed.append(given)

    pose = SimpleNamespace(object=np.array([10.0, 20.0, 3.0]), gel=np.array([40.0, 50.0, 6.0]),
                           spread=np.array([70.0, 80.0, 9.0]), seen=True)  # fmt: skip
    monkeypatch.setattr(trial_crops, "GelSlip", Gel)
    monkeypatch.setattr(
        trial_crops, "TouchFollower", lambda first: SimpleNamespace(follow=lambda _: pose)
    )
    shown = FAMILIES["slip"].look(Scene([plain(0)] * 3, 50.0, 0.1))

    assert shown[:, :3].tolist() == [[1.5, 2.5, 1.0]] * 3
    for number, (of_object, of_gel, spread, time_s, seen) in enumerate(pushed):
        np.testing.assert_allclose(of_object, [1.0, 2.0, 3.0])
        np.testing.assert_allclose(of_gel, [4.0, 5.0, 6.0])
        np.testing.assert_allclose(spread, [7.0, 8.0, 9.0])
        assert (time_s, seen) == (number / 50.0, True)


def test_movements_are_in_millimetres_and_radians(monkeypatch: pytest.MonkeyPatch):
    pose = SimpleNamespace(
        object=np.array([10.0, 20.0, 3.0]), gel=np.array([40.0, 50.0, 6.0]), seen=True
    )
    monkeypatch.setattr(
        trial_crops, "TouchFollower", lambda first: SimpleNamespace(follow=lambda _: pose)
    )
    shown = FAMILIES["moves"].look(Scene([plain(0)] * 2, 50.0, 0.1))
    np.testing.assert_allclose(shown, [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1.0]] * 2)


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_a_family_is_kept_under_its_version_and_number_of_columns(name: str):
    family = FAMILIES[name]
    assert family.key.startswith(f"{family.version}-{family.columns}-")


def test_the_slip_family_s_version_ends_in_eight_digits_of_its_columns_names():
    assert re.fullmatch("slip-2-[0-9a-f]{8}", FAMILIES["slip"].version)


def test_a_family_is_looked_at_camera_by_camera():
    scenes = [Scene([plain(level)] * 9, 25.0, 0.065) for level in (50, 100)]
    shown = look_at(["stills"], scenes)["stills"]

    assert shown.shape == (3, 2, FAMILIES["stills"].columns)
    assert shown[0, :, 0].tolist() == [50.0, 100.0]


@pytest.mark.parametrize("name", ["pixels", "slip", "stills"])
def test_of_few_images_the_last_one_stands_still_until_there_are_enough(name: str):
    scene = Scene([plain(10 * n) for n in range(3)], 25.0, 0.065)
    held = Scene([plain(10 * min(n, 2)) for n in range(8)], 25.0, 0.065)
    shown, wanted = (look_at([name], [own])[name] for own in (scene, held))
    np.testing.assert_array_equal(shown, wanted)
