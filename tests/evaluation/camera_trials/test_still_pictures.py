"""Trials in which nothing moves are recognised by how they look; bundles of before still open."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from trial_makers import some_trials

import taxel.training.camera_trials.blend as blending
from taxel.bundles.trials import read_trial_bundle
from taxel.evaluation.camera_trials.contenders import BAR, OURS
from taxel.evaluation.camera_trials.crossval import judge_trials
from taxel.evaluation.camera_trials.final import fit_final
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.trial_set import Sight, load_trial_set
from taxel.live.whole_trials import predict_trials
from taxel.training.camera_trials.blend import fit_blend
from taxel.training.camera_trials.members import MEMBERS, extra
from taxel.training.camera_trials.novelty import Novelty, novelty_columns
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_crops import USUAL

COLOURS = {"brick": (150, 80, 80), "moss": (80, 116, 80), "slate": (85, 85, 175)}
"""Class → colour of its patch, red first."""


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blending, "TREES", 20)
    monkeypatch.setattr(blending, "INNER_TREES", 10)


def write_stills(folder: Path, objects: int = 4, each: int = 2) -> Path:
    """Write trials of eight equal images, a patch on a ground of the object's own grey."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    lines = ["camera:gel,label:kind,group:object"]
    for thing in range(objects):
        for number in range(each):
            for kind, colour in COLOURS.items():
                image = np.full((60, 80, 3), 90 + 5 * thing, np.float32)
                image[20:44, 26:54] = colour
                image += rng.normal(0, 6.0, image.shape)
                name = f"{kind}-{thing}-{number}"
                (folder / name).mkdir()
                kept = np.clip(image, 0, 255).astype(np.uint8)[..., ::-1]
                for frame in range(8):
                    cv2.imwrite(str(folder / name / f"{frame}.png"), kept)
                lines.append(f"{name},{kind},object {thing}")
    (folder / "trials.csv").write_text("\n".join(lines) + "\n")
    return folder / "trials.csv"


@pytest.mark.slow
def test_a_patchs_colour_tells_classes_where_nothing_moves(tmp_path: Path) -> None:
    """On objects held out, where a forest on movement is at chance."""
    read = read_camera_trials(write_stills(tmp_path / "a"))
    trials = load_trial_set(read, "kind", tmp_path / "kept")
    split = split_trials(trials.groups, trials.y, "group:object", 2, 0)
    ours, bar = judge_trials(trials, split, 0, (OURS, BAR))
    assert ours.whole.accuracy >= 0.95
    assert ours.whole.loss < 0.2
    assert bar.whole.accuracy < 0.6

    blend = fit_blend(trials.learning(trials.rows, "object"), 1, trials.widths, 0)
    weights = dict(zip((m.kind for m in blend.members), blend.weights, strict=True))
    assert "movement" not in weights
    assert "picture" in weights


@pytest.mark.slow
@pytest.mark.parametrize(
    "views",
    [USUAL, ("pixels", "slip", "stills"), (*USUAL, "touch")],
    ids=["usual", "before", "touch"],
)
def test_a_bundle_says_of_images_what_the_trained_blend_says(
    views: tuple[str, ...], tmp_path: Path
) -> None:
    """With the picture; without it, as bundles were before; and with the touch encoder."""
    read = read_camera_trials(write_stills(tmp_path / "a", each=1))
    trials = load_trial_set(read, "kind", tmp_path / "kept", sight=Sight(views=views))
    split = split_trials(trials.groups, trials.y, "group:object", 2, 0)
    (tmp_path / "b.taxel").write_bytes(fit_final(trials, read, split, 0, {}).bundle)
    bundle = read_trial_bundle(tmp_path / "b.taxel")
    assert bundle.contract.views == views

    blend = fit_blend(trials.learning(trials.rows, "object"), 1, trials.widths, 0)
    seen = {member.kind for member in blend.members}
    assert ("picture" in seen) == ("picture" in views)
    assert ("touch" in seen) == ("touch" in views)
    wanted = blend.trials(trials.rows, trials.cut.trial)
    verdicts = list(predict_trials(bundle, read, 0.0))
    found = np.stack([verdict.probabilities for verdict in verdicts])
    np.testing.assert_allclose(found, wanted, atol=1e-4)


def test_members_are_of_seven_kinds_and_what_sees_one_view_alone_is_none_of_the_others() -> None:
    kinds = [member.kind for member in MEMBERS]
    assert kinds.count("movement") == 3
    (changes,) = [member for member in MEMBERS if member.name == "extra-trees on changes"]
    assert changes.kind == "changes"
    assert kinds.count("changes") == 1
    (stills,) = [member for member in MEMBERS if member.name == "extra-trees on stills"]
    assert stills.kind == "look"
    assert kinds.count("picture") == kinds.count("miniature") == 2
    assert kinds.count("network") == kinds.count("touch") == 1
    assert set(kinds) == {"movement", "changes", "look", "picture", "miniature", "network", "touch"}


def test_extra_trees_find_two_columns_that_matter_among_a_thousand() -> None:
    """They look at enough columns for each split: at the root of all they would miss the two."""
    rng = np.random.default_rng(0)
    y = rng.integers(0, 2, 240)
    rows = rng.normal(size=(240, 1000))
    rows[:, :2] += 2.0 * y[:, None]
    fitted = extra(0, 100, 1000).fit(rows[:120], y[:120])
    assert fitted.score(rows[120:], y[120:]) > 0.85
    assert extra(0, 1, 2304).max_features == 400
    assert extra(0, 1, 1).max_features == 1


def test_what_a_picture_shows_makes_nothing_novel() -> None:
    """Its many columns would outweigh those by which a trial is unlike what was learned."""
    rows = some_trials().rows[:, :40]
    novelty = Novelty.of(rows, novelty_columns({"pixels": 30, "picture": 6, "touch": 4}))
    other = rows.copy()
    other[:, 30:36] += 100.0
    assert np.array_equal(novelty.measure(other), novelty.measure(rows))
    other[:, 36:] += 100.0
    assert (novelty.measure(other) > novelty.measure(rows)).all()
