"""Trials of one image, or of fewer than a crop: they work in every verb, and no length shows."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from trial_makers import by_colour, few_small_members

import taxel.training.camera_trials.blend as blending
from taxel.actions.rule_table import RuleTable
from taxel.cli.live.trials import live_trials
from taxel.cli.main import main
from taxel.errors import BadDataset, BadTable
from taxel.evaluation.audit.reading import read_touch
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_crops import FAMILIES, LEAST_CROP, MOVEMENT, Scene, look_at

Lines = Callable[..., str]


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few and small members, one of stills: tests look at wiring, not at accuracy."""
    few_small_members(monkeypatch)
    (stills,) = [own for own in blending.MEMBERS if own.name == "extra-trees on stills"]
    few = ((blending.MEMBERS[0], stills), lambda line: None)
    monkeypatch.setattr(blending.fit_blend, "__defaults__", few)


@pytest.fixture
def taxel(capsys: pytest.CaptureFixture[str]) -> Lines:
    def run(*words: object) -> str:
        main([str(word) for word in words])
        return capsys.readouterr().out

    return run


def picture(number: int, rough: bool) -> NDArray[np.uint8]:
    """A picture of a touch, shape (48, 64, 3): fine stripes where it is rough."""
    rng = np.random.default_rng(number)
    x = np.arange(64)[None, :, None] * (1.5 if rough else 0.2)
    levels = 120 + 60 * np.sin(x + rng.uniform(0, 6)) + rng.normal(0, 3, (48, 64, 3))
    return np.clip(levels, 0, 255).astype(np.uint8)


def pictures(folder: Path, ending: str = ".png", longer: int = 0) -> Path:
    """Write a table of 24 single images; some trials are folders of more where `longer` is set."""
    folder.mkdir(parents=True)
    lines = ["camera:gel,label:surface,group:object"]
    for number in range(24):
        rough = number % 2 == 1
        cell = f"touch_1_img_{number}{ending}"
        if longer and number % 4 < 2:
            cell = f"t{number}"
            (folder / cell).mkdir()
            for at in range(longer):
                cv2.imwrite(str(folder / cell / f"{at}.png"), picture(number, rough))
        else:
            cv2.imwrite(str(folder / cell), picture(number, rough))
        lines.append(f"{cell},{'rough' if rough else 'smooth'},object {number // 4}")
    table = folder / "touches.csv"
    table.write_text("\n".join(lines) + "\n")
    return table


@pytest.mark.parametrize("ending", [".png", ".jpg", ".bmp", ".tif"])
def test_a_cell_that_names_an_image_is_a_trial_of_one_frame(tmp_path: Path, ending: str) -> None:
    """Its neighbours, whose names differ in their number only, are not taken for its frames."""
    trials = read_camera_trials(pictures(tmp_path / "set", ending))
    assert [(trial.frames, trial.width, trial.height) for trial in trials] == [(1, 64, 48)] * 24
    image = trials[5].images(0, [0])[0]
    assert np.abs(image[..., ::-1].astype(int) - picture(5, True)).max() <= (
        25 if "j" in ending else 0
    )


def test_one_image_has_no_movement_and_few_stand_still_at_their_end() -> None:
    first, other = picture(0, True), picture(1, False)
    alone = look_at(tuple(FAMILIES), [Scene([first], 25.0, 0.065, by_colour)])
    assert all(not alone[name].any() and len(alone[name]) == LEAST_CROP for name in MOVEMENT)
    np.testing.assert_array_equal(alone["stills"][0], alone["stills"][2])
    pair, seven = [first, other], [first, *[other] * 7]
    few = look_at(tuple(FAMILIES), [Scene(pair, 25.0, 0.065, by_colour)])
    held = look_at(tuple(FAMILIES), [Scene(seven, 25.0, 0.065, by_colour)])
    for name in FAMILIES:
        np.testing.assert_array_equal(few[name], held[name])


@pytest.mark.slow
def test_single_images_go_from_a_table_to_equal_verdicts_live_and_offline(
    tmp_path: Path, taxel: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    table, cache = pictures(tmp_path / "set"), tmp_path / "cache"
    out = taxel("evaluate", table, "--cache", cache)
    assert out.count("trials of 1 frame: pictures alone, no motion") == 1
    taxel("train-trials", table, "--cache", cache, "--output", "run")
    bundle = tmp_path / "run" / "recogniser.taxel"
    offline = json.loads(taxel("evaluate-trials", bundle, table, "--json"))["verdicts"]
    assert len({own["verdict"] for own in offline} - {"UNKNOWN"}) == 2
    live = json.loads(taxel("live", bundle, table, "--json"))["trials"]
    assert [(own["trial"], own["verdict"]) for own in live] == [
        (own["trial"], own["verdict"]) for own in offline
    ]
    np.testing.assert_array_equal(
        [own["confidence"] for own in live], [own["confidence"] for own in offline]
    )


@pytest.mark.slow
def test_single_images_are_imported_and_their_recordings_judged(
    tmp_path: Path, taxel: Lines
) -> None:
    table, made = pictures(tmp_path / "set"), tmp_path / "made"
    taxel("import", table, "--output", made)
    out = taxel("evaluate-trials", made, "--cache", tmp_path / "cache")
    assert "24 trials of 1 camera" in out


@pytest.mark.slow
def test_beside_longer_trials_no_crop_shows_which_are_of_one_image(
    tmp_path: Path, taxel: Lines
) -> None:
    """The longer ones hold the same picture over and over: nothing but length would differ."""
    table = pictures(tmp_path / "set", longer=5)
    found = json.loads(taxel("evaluate-trials", table, "--cache", tmp_path / "cache", "--json"))
    assert (found["crop"], found["crops_a_trial"]) == (1, 3)
    assert "leave those out to see motion in the others" in found["note"]


@pytest.mark.parametrize("source", ["set/touch_1_img_0.png", "clip.avi", "set/t0"])
def test_live_says_that_a_table_of_a_video_works_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str
) -> None:
    pictures(tmp_path / "set", longer=2)
    (tmp_path / "set" / "touch_1_img_0.png").write_bytes(b"")
    (tmp_path / "clip.avi").write_bytes(b"RIFF")
    contract = SimpleNamespace(cameras=1, crop=1)
    monkeypatch.setattr(
        "taxel.bundles.trials.read_trial_bundle", lambda *_: SimpleNamespace(contract=contract)
    )
    words = {"as_json": True, "rules": RuleTable(()), "device": "cpu"}
    with pytest.raises(BadTable, match=r"works in place, as taxel live BUNDLE trials\.csv"):
        live_trials(tmp_path / "a.taxel", str(tmp_path / source), None, 0.5, **words)
    with pytest.raises(BadTable, match="works in place"):
        read_camera_trials(tmp_path / source)


def test_audit_names_the_verb_for_single_images(tmp_path: Path) -> None:
    with pytest.raises(
        BadDataset, match=r"3 different frames.*24 trials.*taxel evaluate-trials --split"
    ):
        read_touch(pictures(tmp_path / "set"), None, lambda *_: None)


def test_a_damaged_image_gives_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    """Before, a warning of OpenCV stood above it."""
    table = pictures(tmp_path / "set")
    image = tmp_path / "set" / "touch_1_img_0.png"
    image.write_bytes(image.read_bytes()[:1000])
    words = ["train-trials", table, "--no-network", "--cache", tmp_path / "cache"]
    run = tmp_path / "run"
    command = [sys.executable, "-m", "taxel.cli.main", *map(str, words), "--output", str(run)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert f"{image}: a damaged one" in ended.stderr
    assert not run.exists()


def test_a_split_that_cannot_be_made_is_refused_before_images_are_looked_at(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before, all trials were looked at first, which takes long."""
    cache = tmp_path / "cache"
    table = pictures(tmp_path / "set")
    with pytest.raises(SystemExit):
        main(["evaluate-trials", str(table), "--split", "group:cup", "--cache", str(cache)])
    assert "cup" in capsys.readouterr().err
    assert not cache.exists()
