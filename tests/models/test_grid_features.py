"""Features of taxels in a grid: the imprint of a touch, wherever it lies."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch

from taxel.bundles.engine import open_engine
from taxel.bundles.writer import Classifier, export_onnx
from taxel.errors import BadInput
from taxel.models.blend import Blend, Part, Plan, read_plan
from taxel.models.grid_features import IMAGE_BLOCKS, Grid, grids_of, imprints
from taxel.models.touch_blocks import GRID
from taxel.models.touch_features import compute_features, pads_of
from taxel.training.choose.candidates import FEATURE_SETS, IMPRINTS, Candidate, feature_sets
from taxel.training.choose.fitting import fit_head, head_logits

ROWS, COLUMNS = 10, 14
NAMES = tuple(f"r{r}c{c}" for r in range(1, ROWS + 1) for c in range(1, COLUMNS + 1))
GRIDS = grids_of(NAMES)
PADS = pads_of(NAMES)
Y, X = np.indices((ROWS, COLUMNS))


def blob(y: float, x: float, tall: float, wide: float) -> np.ndarray:
    """Return the image of a smooth touch, shape (taxels,)."""
    return np.exp(-(((Y - y) / tall) ** 2) - ((X - x) / wide) ** 2).ravel().astype(np.float32)


def one_row(images: list[np.ndarray], block: str) -> np.ndarray:
    """Return a block's features of windows of one row."""
    values = np.stack(images)[:, None]
    return compute_features((block,), PADS, values, np.ones((len(images), 1), bool), GRIDS)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (NAMES, (Grid(10, 14, 0, 14, 1),)),
        (("force", *(f"left_row{r}_col{c}" for r in range(3) for c in range(4))),
         (Grid(3, 4, 1, 4, 1),)),
        (tuple(f"r{r}c{c}" for c in range(4) for r in range(3)), (Grid(3, 4, 0, 1, 3),)),
        (tuple(f"r{r}c{c}_{axis}" for r in range(3) for c in range(3) for axis in "xyz"),
         (Grid(3, 3, 0, 9, 3), Grid(3, 3, 1, 9, 3), Grid(3, 3, 2, 9, 3))),
        (NAMES[:-1], ()),
        ((NAMES[1], NAMES[0], *NAMES[2:]), ()),
        (tuple(f"r{r}c{c}" for r in range(2) for c in range(9)), ()),
        (tuple(f"thumb{n}" for n in range(16)), ()),
        (tuple(f"sensor{r}c{c}" for r in range(4) for c in range(4)), ()),
        (tuple(f"finger{r}_c{c}" for r in range(4) for c in range(4)), ()),
        (tuple(f"r{r}c{c}" for r in (1, 2, 9) for c in range(3)), ()),
        ((*NAMES, "R1C1", "r01c1"), ()),
        (tuple(f"r{'1' * 5000}c{n}" for n in range(9)), ()),
    ],
)  # fmt: skip
def test_grids_are_known_by_the_names_of_their_channels(
    names: tuple[str, ...], expected: tuple[Grid, ...]
):
    """By rows, by columns, of several axes; what is not complete or in order is no grid."""
    assert grids_of(names) == expected


def test_a_grid_is_one_pad():
    """Not each of its rows, though their names differ in the last number only."""
    two = tuple(f"{side}_{name}" for side in ("left", "right") for name in NAMES)

    assert set(pads_of(NAMES)) == {0}
    assert pads_of(two) == (0,) * len(NAMES) + (1,) * len(NAMES)


def test_an_imprint_is_where_and_as_wide_as_it_was_drawn():
    """Beside the moments computed straight from their definition."""
    image = blob(3.0, 9.0, 1.0, 2.0)
    found = one_row([image], "imprint")[0]

    above = np.clip(image.astype(float) - np.float32(image.mean(dtype=float)), 0.0, None)
    share = above / above.sum()
    y, x = ((axis.ravel() - axis.mean()) / 7.0 for axis in (Y, X))
    down, across = y - (share * y).sum(), x - (share * x).sum()

    def moment(a: int, b: int) -> float:
        return float((share * down**a * across**b).sum())

    middle, apart = (moment(2, 0) + moment(0, 2)) / 2, (moment(2, 0) - moment(0, 2)) / 2
    length = np.hypot(apart, moment(1, 1))
    expected = [
        image.mean(), above.mean(), above.max(), (share * y).sum(), (share * x).sum(),
        moment(2, 0), moment(0, 2), moment(1, 1), middle + length, middle - length,
        moment(3, 0), moment(2, 1), moment(1, 2), moment(0, 3), moment(2, 2),
        above.mean() / above.max(), above.mean() ** 2 / (above**2).mean(),
        (above**2).mean() ** 2 / (above**4).mean(),
    ]  # fmt: skip
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)
    assert found[3] < 0.0 < found[4]
    assert found[5] < found[6]


@pytest.mark.parametrize("block", sorted(IMAGE_BLOCKS))
def test_a_touch_elsewhere_looks_alike(block: str):
    """Moved by a few taxels it gives the same numbers, but for its place; another does not."""
    side = 38
    grid = Grid(side, side, 0, side, 1)
    y, x = np.indices((side, side))
    here, there, other = (
        (100.0 * np.exp(-(((y - at) / tall) ** 2) - ((x - at) / 2) ** 2)).ravel().astype(np.float32)
        for at, tall in ((16, 1.0), (20, 1.0), (16, 1.5))
    )
    values = np.stack([here, there, other])[:, None]

    found = compute_features((block,), (0,) * side**2, values, np.ones((3, 1), bool), (grid,))

    if block == "imprint":
        assert found[0, 3] < found[1, 3]
        assert found[0, 4] < found[1, 4]
        found = np.delete(found, (3, 4), axis=1)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-4, atol=1e-4)
    assert np.abs(found[0] - found[2]).max() > 0.01


@pytest.mark.parametrize("sides", [(3, 3), (3, 900), (64, 64), (500, 4)])
def test_grids_of_any_size_have_patterns(sides: tuple[int, int]):
    """Of large ones the coarser images are looked at, of narrow ones those that are left."""
    grid, count = Grid(*sides, 0, sides[1], 1), sides[0] * sides[1]
    values = np.random.default_rng(0).normal(size=(2, 1, count)).astype(np.float32)
    given = (0,) * count, values, np.ones((2, 1), bool), (grid,)

    for block in IMAGE_BLOCKS:
        found = compute_features((block,), *given)
        assert np.isfinite(found).all()
        assert not np.array_equal(found[0], found[1])
    assert compute_features(("image patterns",), *given).shape[1] <= 504


def test_an_untouched_pad_has_numbers():
    """No division by nothing: a flat image has an imprint of 0."""
    found = [one_row([np.full(len(NAMES), 7.25, np.float32)], block)[0] for block in IMAGE_BLOCKS]

    assert all(np.isfinite(own).all() for own in found)
    np.testing.assert_array_equal(found[0], [7.25, *[0.0] * 17])


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e9])
def test_an_imprint_s_shape_does_not_depend_on_the_unit(unit: float):
    """Volts or microvolts: where it lies, how wide and how even it is stay."""
    image = blob(3.0, 9.0, 1.0, 2.0)
    here, other = one_row([image, image * np.float32(unit)], "imprint")

    np.testing.assert_allclose(other[:3], here[:3] * unit, rtol=1e-5)
    np.testing.assert_allclose(other[3:], here[3:], rtol=1e-4, atol=1e-6)


def test_a_touch_that_stands_still_has_a_still_imprint():
    """It is its own mean to the last digit, however long the trial is: no rounding is learned."""
    image = blob(4.0, 6.0, 1.3, 2.1)
    spread = []
    for rows in (2, 7, 12):
        still = np.tile(image, (1, rows, 1)), np.ones((1, rows), bool)
        spread.append(compute_features((f"{GRID}statistics",), PADS, *still, GRIDS)[0])

    np.testing.assert_array_equal(spread[0], spread[1])
    np.testing.assert_array_equal(spread[0], spread[2])


def drawn(count: int, steps: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return touches of two shapes anywhere on the pad, and their classes."""
    random = np.random.default_rng(seed)
    y = np.arange(count) % 2
    sizes = [(1.0, 2.0), (2.0, 1.0)]
    images = np.stack([blob(*random.uniform((2, 3), (7, 10)), *sizes[own]) for own in y])
    rise = np.linspace(1.0, 0.2, steps)[None, :, None]
    values = rise * images[:, None] + 0.05 * random.normal(size=(count, steps, len(NAMES)))
    return (100.0 * values).astype(np.float32), y


def test_shapes_are_told_apart_wherever_they_lie():
    """Few touches suffice, of which taxels by themselves show nothing."""
    values, y = drawn(120, 1, 0)
    mask = np.ones((120, 1), bool)
    model = Candidate("discriminant", "winsorised-discriminant", "imprints", 0.3)

    def accuracy(blocks: tuple[str, ...]) -> float:
        features = compute_features(blocks, PADS, values, mask, GRIDS)
        head = fit_head(model, features[:60], y[:60], 2, 0)
        return float((head_logits(head, features[60:]).argmax(axis=1) == y[60:]).mean())

    assert accuracy(feature_sets(1, len(NAMES), grids=True)["imprints"]) > 0.95
    assert accuracy(("rows",)) < 0.8


@pytest.mark.parametrize("padded", [False, True])
def test_live_is_as_offline(padded: bool):
    """The exported model gives what PyTorch gives; padding is no feature."""
    values, y = drawn(60, 8, 1)
    mask = np.ones((60, 8), bool)
    if padded:
        mask[::3, 5:] = False
        values = values * mask[:, :, None]
    blocks = feature_sets(8, len(NAMES), padded, grids=True)["imprints"]
    features = compute_features(blocks, PADS, values, mask, GRIDS)
    head = fit_head(Candidate("trees", "extra-trees", "imprints", 2), features, y, 2, 0)
    plan = Plan(8, PADS, 2, (Part("trees", blocks),), padded, GRIDS)
    blend = Blend(plan, (head,), (1.0,), (1.0,)).eval()

    whole = Classifier((blend,)).eval()
    with torch.inference_mode():
        offline = whole(torch.from_numpy(values), torch.from_numpy(mask)).numpy()
    given = {"values": values, **({"mask": mask} if padded else {})}
    found = open_engine(export_onnx(whole, 8, len(NAMES))).run(**given)
    np.testing.assert_allclose(found, offline, atol=1e-6)
    if padded:
        short = compute_features(blocks, PADS, values[::3, :5], mask[::3, :5], GRIDS)
        np.testing.assert_allclose(features[::3], short, rtol=1e-4, atol=1e-5)
    again = Blend()
    again.load_state_dict(blend.state_dict())
    with torch.inference_mode():
        loaded = Classifier((again,))(torch.from_numpy(values), torch.from_numpy(mask)).numpy()
    np.testing.assert_array_equal(loaded, offline)


def test_arrays_without_a_grid_are_seen_as_before():
    """No set of theirs has anything of grids; a grid has all the sets there are."""
    assert not IMPRINTS & set(feature_sets(60, 40))
    assert set(feature_sets(60, 40, grids=True)) - set(feature_sets(60, 40)) == IMPRINTS
    assert "imprints and level" not in feature_sets(1, 40, grids=True)
    assert feature_sets(1, 40, grids=True)["imprints"] == tuple(IMAGE_BLOCKS)
    for name in IMPRINTS:
        assert any(block.startswith(GRID) for block in FEATURE_SETS[name])


@pytest.mark.parametrize(
    "grids",
    [
        [], [[2, 14, 0, 14, 1]], [[10, 14, 0, 15, 1]], [[10, 14, -1, 14, 1]],
        [[10, 14, 0, 14]], [[10_000_000, 10_000_000, 0, 0, 0]], "none",
        [[3, 3, 0, 1e30, 0]], [[3, 3, 0, 0, 0]], [[3, 3, 0, 4, 1], [3, 3, 0, 4, 1]],
        [[3.5, 3, 0, 14, 1]],
    ],
)  # fmt: skip
def test_weights_that_name_no_such_grid_are_refused(grids: object):
    """Nothing is looked for beyond the channels."""
    plan = Plan(1, PADS, 2, (Part("linear", ("imprint",)),), False, GRIDS)
    good = asdict(plan)
    assert read_plan(json.dumps(good).encode()) == plan

    with pytest.raises(BadInput, match="plan"):
        read_plan(json.dumps({**good, "grids": grids}).encode())
    older = {name: own for name, own in good.items() if name != "grids"}
    older["parts"] = [asdict(Part("linear", ("rows",)))]
    assert read_plan(json.dumps(older).encode()) == replace(
        plan, parts=(Part("linear", ("rows",)),), grids=()
    )


def test_each_scan_has_its_own_imprint():
    """Of two grids side by side the numbers follow each other."""
    image = np.stack([blob(3.0, 5.0, 1.0, 1.5), blob(5.0, 9.0, 1.0, 1.5)])
    both = torch.from_numpy(np.concatenate([image, image[::-1]], axis=1)).double().unsqueeze(0)
    grids = (GRIDS[0], GRIDS[0]._replace(first=len(NAMES)))

    found = imprints(both, grids)[0]

    assert found.shape == (2, 36)
    torch.testing.assert_close(found[0, :18], found[1, 18:])
    assert found[0, 3] < found[0, 21]
