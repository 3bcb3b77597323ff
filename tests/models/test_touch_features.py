"""Features ignore padding, and the blend that sees them is one model offline and in ONNX."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from taxel.bundles.engine import open_engine
from taxel.bundles.model_check import check_model
from taxel.bundles.writer import Classifier, export_onnx
from taxel.errors import BadInput
from taxel.models.blend import Blend, Part, Plan, read_plan
from taxel.models.onnx_session import WindowModel
from taxel.models.touch_blocks import BLOCKS, START_ROWS, UNIT
from taxel.models.touch_features import (
    TouchFeatures,
    compute_features,
    fitting_blocks,
    pads_of,
    seen_rows,
)
from taxel.training.choose.candidates import Candidate, feature_sets
from taxel.training.choose.fitting import FITS, fit_head, head_logits

RNG = np.random.default_rng(0)
STEPS, CHANNELS, CLASSES = 24, 6, 3
VALUES = RNG.normal(size=(90, STEPS, CHANNELS)).astype(np.float32)
Y = np.arange(90) % CLASSES
VALUES[np.arange(90), :, Y] += 3.0
MASK = np.ones((90, STEPS), bool)
PADS = (0,) * CHANNELS


def padded(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the windows' first rows, behind which zeros stand."""
    mask = np.arange(STEPS)[None].repeat(90, 0) < rows
    return VALUES * mask[:, :, None], mask


@pytest.mark.parametrize(
    "block",
    sorted(set(BLOCKS) - {"rows", "centred", "octaves", "spectrum", "distribution"}),
)
def test_padding_is_no_feature(block: str):
    """A short window gives what it gives with rows of padding behind it."""
    values, mask = padded(12)

    long = compute_features((block,), PADS, values, mask)
    short = compute_features((block,), PADS, values[:, :12], mask[:, :12])

    np.testing.assert_allclose(long, short, rtol=1e-5, atol=1e-6)


def test_a_gain_and_an_offset_of_the_whole_pad_leave_its_standardised_rows():
    plain = compute_features((f"{UNIT}rows",), PADS, VALUES, MASK)
    changed = compute_features((f"{UNIT}rows",), PADS, 2.0 * VALUES + 5.0, MASK)

    np.testing.assert_allclose(plain, changed, rtol=1e-3, atol=1e-3)


def test_channels_that_differ_in_their_last_number_are_one_pad():
    names = tuple(f"{pad}_{i}" for pad in ("thumb", "index") for i in range(1, 5))

    assert pads_of(names) == (0,) * 4 + (1,) * 4
    assert pads_of(("left", "right")) == (0, 0)


def test_the_strongest_frequency_stands_out_of_the_spectrum():
    """A sine of 8 rows a turn: in stretches of 8 rows that is the first frequency."""
    row = np.arange(16)
    values = np.sin(2 * np.pi * row / 8).astype(np.float32)[None, :, None]

    found = compute_features(("spectrum",), (0,), values, np.ones((1, 16), bool))[0]

    assert found.argmax() == 0
    assert found[0] > found[2] + 5


def test_a_long_window_is_seen_by_averages_of_its_rows():
    """1,200 rows are 400 averages of three; what changes from row to row is still seen."""
    slow = RNG.normal(size=(3, 400, 2)).astype(np.float32)
    quick = np.tile([1.0, 0.0, -1.0], 400).astype(np.float32)[None, :, None]
    long = slow.repeat(3, axis=1) + quick
    mask = np.ones((3, 1200), bool)

    means = compute_features(("statistics",), (0, 0), long, mask)
    octaves = compute_features(("octaves",), (0, 0), long, mask)

    np.testing.assert_allclose(
        means, compute_features(("statistics",), (0, 0), slow, mask[:, ::3]), rtol=1e-4, atol=1e-5
    )
    still = compute_features(("octaves",), (0, 0), slow.repeat(3, axis=1), mask)
    assert (octaves[:, :2] > still[:, :2] + 0.5).all()


BLOCKS_OF_MANY = ("level", "course", "shape", "octaves", f"{UNIT}level")


def test_a_large_window_of_many_channels_is_seen_by_evenly_spaced_rows():
    """100 rows of 1,000 channels: 40 of them; without it they left time for means alone."""
    values = RNG.normal(size=(2, 100, 1000)).astype(np.float32)
    mask = np.ones((2, 100), bool)
    pads = (0,) * 600 + (1,) * 400
    spaced = ((np.arange(40) + 0.5) / 40 * 100).astype(int)

    large = compute_features(BLOCKS_OF_MANY, pads, values, mask)
    thin = compute_features(BLOCKS_OF_MANY, pads, values[:, spaced], mask[:, spaced])

    np.testing.assert_array_equal(large, thin)
    assert seen_rows(40_000, 20) == 40_000  # long, of few channels: rows are averaged
    assert seen_rows(100, 16_384) == 8
    assert fitting_blocks(BLOCKS_OF_MANY, 100, 16_384) == BLOCKS_OF_MANY


def test_a_short_trial_of_many_channels_is_seen_by_as_many_rows_as_a_long_one_live_and_offline():
    """Of every third row a trial of three rows would have one, which shows how short it is."""
    values = RNG.normal(size=(4, 100, 1000)).astype(np.float32)
    mask = np.arange(100) < np.array([100, 41, 3, 1])[:, None]
    values *= mask[:, :, None]
    pads = (0,) * 1000

    class Alone(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.features = TouchFeatures(BLOCKS_OF_MANY, pads)

        def forward(self, values: Tensor, mask: Tensor) -> Tensor:
            found: Tensor = self.features(values, mask)
            return found

    live = WindowModel(export_onnx(Alone().eval(), 100, 1000))
    offline = compute_features(BLOCKS_OF_MANY, pads, values, mask)
    for number in range(4):
        part = slice(number, number + 1)
        answered = np.asarray(live(values[part], mask[part]))
        np.testing.assert_allclose(answered.ravel(), offline[number], rtol=1e-4, atol=1e-4)

    rows = ((np.arange(40) + 0.5) / 40 * 3).astype(int)
    whole = compute_features(BLOCKS_OF_MANY, pads, values[2:3, rows], np.ones((1, 40), bool))
    np.testing.assert_array_equal(offline[2:3], whole)


def test_each_pad_is_standardised_by_itself_whatever_its_number():
    values = RNG.normal(size=(2, 24, 10)).astype(np.float32)
    values[:, :, 5:] = 7.0 * values[:, :, :5] + 2.0
    mask = np.ones((2, 24), bool)

    found = compute_features((f"{UNIT}mean",), (3,) * 5 + (9,) * 5, values, mask)

    np.testing.assert_allclose(found[:, :5], found[:, 5:], rtol=1e-4)


@pytest.mark.parametrize("steps", [24, 75, 1300])
def test_channels_that_stand_still_give_the_same_live_as_offline(steps: int):
    """A mean that is rounded otherwise must not become a feature: counts, volts, NaN-free."""
    level = np.array([0.1, 7.2, 30_000.1, 0.0], np.float32)
    values = np.broadcast_to(level, (8, steps, 4)).copy()
    values[4:, steps // 2 :] += np.float32(0.3)
    mask = np.ones((8, steps), bool)
    blocks = fitting_blocks(tuple(name for name in BLOCKS if name != "rows"), steps, 4)
    features = compute_features(blocks, (0,) * 4, values, mask)
    y = np.arange(8) // 4
    head = fit_head(Candidate("trees", "extra-trees", "all", 1), features, y, 2)
    whole = Classifier((Blend(Plan(steps, (0,) * 4, 2, (Part("trees", blocks),)), (head,),
                              (1.0,), (1.0,)),)).eval()  # fmt: skip

    engine = open_engine(export_onnx(whole, steps, 4))
    found = engine.run(values=values, mask=mask)

    with torch.inference_mode():
        wanted = whole(torch.from_numpy(values), torch.from_numpy(mask)).numpy()
    np.testing.assert_allclose(found, wanted, atol=1e-6)


@pytest.mark.parametrize("block", ["course", "parts"])
def test_a_trial_of_fewer_rows_than_parts_leaves_none_empty(block: str):
    """A steady touch of 5 rows gives what one of 20 gives; empty parts would show its length."""
    steady = np.full((1, 24, 2), 3.0, np.float32)
    short, long = (np.arange(24)[None] < rows for rows in (5, 20))

    found = [compute_features((block,), (0, 0), steady * own[:, :, None], own)
             for own in (short, long)]  # fmt: skip

    np.testing.assert_allclose(found[0], found[1], atol=1e-6)
    assert np.abs(found[0] - (3.0 if block == "parts" else 0.0)).max() < 1e-6


def test_parts_are_means_over_equal_times():
    """Of 24 rows each of 16 parts has a row and a half."""
    values = np.arange(24, dtype=np.float32)[None, :, None]

    found = compute_features(("parts",), (0,), values, np.ones((1, 24), bool))[0]

    np.testing.assert_allclose(found[:2], [(0 + 0.5) / 1.5, (0.5 + 2) / 1.5], rtol=1e-6)
    assert found.mean() == pytest.approx(11.5)


def test_a_start_is_means_of_the_first_rows_that_were_measured():
    rows = np.random.default_rng(1).normal(size=(2, 16, 3)).astype(np.float32)
    mask = np.ones((2, 16), bool)
    mask[1, 3:] = False

    found = compute_features(("start",), (0, 0, 0), rows, mask).reshape(2, len(START_ROWS), 3)

    for place, count in enumerate(START_ROWS):
        np.testing.assert_allclose(found[0, place], rows[0, :count].mean(axis=0), atol=1e-6)
        np.testing.assert_allclose(found[1, place], rows[1, : min(count, 3)].mean(axis=0),
                                   atol=1e-6)  # fmt: skip


@pytest.mark.parametrize("shape", [(1100, 2), (40, 2048)])
def test_a_start_is_of_first_rows_where_others_are_averaged_or_spaced(shape: tuple[int, int]):
    rows = np.random.default_rng(2).normal(size=(1, *shape)).astype(np.float32)
    mask = np.ones((1, shape[0]), bool)
    mask[0, 30:] = False

    found = compute_features(("start", "mean"), (0,) * shape[1], rows, mask)

    first = found[0, : len(START_ROWS) * shape[1]].reshape(len(START_ROWS), -1)
    np.testing.assert_allclose(first[0], rows[0, 0], atol=1e-6)
    np.testing.assert_allclose(first[-1], rows[0, : START_ROWS[-1]].mean(axis=0), atol=1e-6)


def test_a_distribution_is_quantiles_of_values_and_of_changes():
    """Of a ramp from 0 to 63: changes over 4 rows are all 4, over 16 rows 16; 64 have no room."""
    values = np.arange(64, dtype=np.float32)[None, :, None]

    found = compute_features(("distribution",), (0,), values, np.ones((1, 64), bool))[0]

    assert found[:13].tolist() == [
        round(share * 63) - 31.5
        for share in (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
    ]  # fmt: skip
    assert found[13:].tolist() == [4.0] * 7 + [16.0] * 7


def test_a_distribution_does_not_see_padding():
    """20 rows give the same behind 4 rows of padding as behind 20; without them it is 0."""
    rows = RNG.normal(size=(5, 40, 2)).astype(np.float32)
    mask = np.arange(40)[None].repeat(5, 0) < 20
    rows[~mask] = 0.0

    few, many = (
        compute_features(("distribution",), (0, 0), rows[:, :steps], mask[:, :steps])
        for steps in (24, 40)
    )

    np.testing.assert_allclose(few, many, atol=1e-6)
    none = compute_features(("distribution",), (0, 0), 0 * rows, np.zeros_like(mask))
    assert not none.any()


def test_windows_with_padding_have_no_distributions_nor_rows():
    whole, some = (feature_sets(24, 4, padded=padded) for padded in (False, True))

    assert set(whole) - set(some) == {
        "all with distributions", "distributions without level", "both rows", "rows",
        "rows across the pad", "rows without level",
    }  # fmt: skip


def test_one_row_of_many_channels_is_its_own_features():
    """One scan of a mat a trial: no set of features was left above 1,500 channels."""
    assert "rows" in feature_sets(1, 2048)
    assert "rows" not in feature_sets(30, 2048)


def test_one_row_has_the_blocks_of_one_row_only():
    assert fitting_blocks(("rows", "shape", f"{UNIT}rows"), 1, 24) == ("rows", f"{UNIT}rows")


def blend() -> Blend:
    every = fitting_blocks(tuple(BLOCKS), STEPS, CHANNELS)
    sets = {"linear": every, "perceptron": (f"{UNIT}shape", "course"), "trees": every}
    models = {"linear": "logistic", "perceptron": "perceptron", "trees": "extra-trees"}
    parts = tuple(Part(head, blocks) for head, blocks in sets.items())
    heads = tuple(
        fit_head(
            Candidate("linear", models[part.head], "", 2.0),
            compute_features(part.blocks, PADS, VALUES, MASK),
            Y,
            CLASSES,
        )
        for part in parts
    )
    return Blend(Plan(STEPS, PADS, CLASSES, parts), heads, (0.4, 0.3, 0.3), (1.0, 0.9, 1.2), 1.1)


@pytest.fixture(scope="module")
def whole() -> Blend:
    return blend().eval()


def test_a_blend_gives_in_onnx_what_it_gives_in_pytorch(whole: Blend):
    """Trees too: features are computed in double precision, so that no window falls elsewhere."""
    model = export_onnx(Classifier((whole,)), STEPS, CHANNELS)
    check_model(model)
    values, mask = padded(17)
    with torch.inference_mode():
        logits = whole(torch.from_numpy(values), torch.from_numpy(mask))
    engine = open_engine(model)

    found = engine.run(values=values, mask=mask)
    alone = engine.run(values=values[:1], mask=mask[:1])

    np.testing.assert_allclose(found, torch.softmax(logits, dim=1).numpy(), atol=1e-5)
    np.testing.assert_allclose(alone, found[:1], atol=1e-6)


def test_a_blend_is_rebuilt_from_its_weights_alone(whole: Blend):
    again = Blend()
    again.load_state_dict(whole.state_dict())
    values, mask = torch.from_numpy(VALUES), torch.from_numpy(MASK)

    with torch.inference_mode():
        assert torch.equal(again.eval()(values, mask), whole(values, mask))


def test_a_plan_that_names_what_there_is_not_is_refused():
    bad = b'{"steps":1,"classes":2,"pads":[0],"parts":[{"head":"linear","blocks":["secret"]}]}'
    with pytest.raises(BadInput, match="plan"):
        read_plan(bad)


@pytest.mark.slow
@pytest.mark.parametrize("model", sorted(FITS))
def test_every_model_learns_which_channel_is_high(model: str):
    features = compute_features(("statistics",), PADS, VALUES, MASK)
    head = fit_head(Candidate("linear", model, "", 0.5 if "discriminant" in model else 2.0),
                    features[:60], Y[:60], CLASSES)  # fmt: skip

    assert (head_logits(head, features[60:]).argmax(axis=1) == Y[60:]).mean() > 0.9


def test_a_forest_as_tables_votes_as_scikit_learn_does():
    from sklearn.ensemble import ExtraTreesClassifier

    from taxel.models.heads import LEAST_SHARE
    from taxel.training.choose.fitting import DEEPEST, SHARE_SEEN, TREES

    features = compute_features(("statistics",), PADS, VALUES, MASK)
    forest = ExtraTreesClassifier(
        TREES, criterion="entropy", max_features=round(SHARE_SEEN * features.shape[1]),
        min_samples_leaf=2, max_depth=DEEPEST, random_state=0,
    )  # fmt: skip
    wanted = forest.fit(features, Y).predict_proba(features)

    head = fit_head(Candidate("trees", "extra-trees", "", 2), features, Y, CLASSES)
    found = np.exp(head_logits(head, features)) - LEAST_SHARE

    np.testing.assert_allclose(found, wanted, atol=2e-3)  # shares are kept in 16 bits
