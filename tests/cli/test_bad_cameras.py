"""Bad videos, labels, weights and options of cameras: one plain line, exit code 2, nothing left."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from safetensors.numpy import save_file

from taxel.cli.main import main
from taxel.windows import camera_trials


def write_video(path: Path, frames: int, hz: float = 30.0, *, grey: bool = False) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), hz, (64, 48))
    random = np.random.default_rng(0)
    for _ in range(frames):
        image = random.integers(0, 256, (48, 64, 3), np.uint8)
        if grey:
            image[...] = image[..., :1]
        writer.write(image)
    writer.release()


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory, few_pours: Path) -> Path:
    """Videos sound and bad, each with its table; pours; weights of a wrong shape."""
    world = tmp_path_factory.mktemp("cameras")
    write_video(world / "good.avi", 60)
    write_video(world / "long.avi", 75)
    write_video(world / "slow.avi", 60, 25.0)
    write_video(world / "grey.avi", 60, grey=True)
    whole = (world / "good.avi").read_bytes()
    (world / "cut.avi").write_bytes(whole[: len(whole) // 2])
    (world / "empty.avi").write_bytes(b"")
    (world / "text.avi").write_text("no video\n" * 40)
    for name in ("long", "slow", "grey", "cut", "empty", "text", "absent"):
        (world / f"{name}.csv").write_text(
            f"left,right,label:outcome,group:cup\ngood.avi,{name}.avi,slip,a\n"
        )
    (world / "one.csv").write_text("left,label:outcome,group:cup\ngood.avi,slip,a\n")
    (world / "blank.csv").write_text("left,right,label:outcome,group:cup\ngood.avi,,slip,a\n")
    shutil.copytree(few_pours, world / "pours")
    (world / "lonely").mkdir()
    first = min((world / "pours").glob("*.mcap"))
    shutil.copy(first, world / "lonely" / "only.mcap")
    shutil.copy(first, world / "pour.mcap")
    (world / "cache").mkdir()
    save_file({"classifier.weight": np.zeros((3, 3), np.float32)}, world / "wrong.safetensors")
    (world / "nothing").mkdir()
    main(["import", str(world / "one.csv"), "--output", str(world / "single")])
    return world


CASES = {
    "8-bit numbers by PyTorch, tables": "reproduce transition-tables --engine torch "
    "--precision int8",
    "8-bit numbers by PyTorch, warnings": "reproduce grasp-warnings --data pours --engine torch "
    "--precision int8",
    "8-bit numbers by PyTorch, monitor": "train-monitor pours --features edge --output out.taxel "
    "--engine torch --precision int8",
    "threads of PyTorch": "train-monitor pours --features edge --output out.taxel --engine torch "
    "--threads 2",
    "unequal length": "import long.csv --output out",
    "unequal rate": "import slow.csv --output out",
    "grey frames": "import grey.csv --output out",
    "truncated AVI": "import cut.csv --output out",
    "AVI of no length": "import empty.csv --output out",
    "text for an AVI": "import text.csv --output out",
    "a video that is not there": "import absent.csv --output out",
    "one camera where two are needed": "train-monitor single --output out.taxel --cache cache",
    "one camera missing in a row": "import blank.csv --output out",
    "label after the video": "label pour.mcap --onset 99 --cache cache",
    "label before the video": "label pour.mcap --frame -1 --cache cache",
    "label of a rule that is not": "label pour.mcap --rule wobble --cache cache",
    "weights of the wrong shape": "reproduce transition-tables --data pours "
    "--weights wrong.safetensors",
    "weights that are not there": "reproduce transition-tables --data pours --weights none.pth",
    "tables of a folder without pours": "reproduce transition-tables --data nothing",
    "warnings without a folder": "reproduce grasp-warnings",
    "warnings of one cup": "reproduce grasp-warnings --data lonely --rule gross-slip "
    "--features gel --cache cache",
    "warnings of a backbone that is not": "reproduce grasp-warnings --data pours --features best",
    "precisions of what runs in no engine": "reproduce precisions --data pours --backbones gel",
    "trials without the label": "evaluate-trials pours --target slipped --cache cache",
    "trials of an array's verb": "train pours --output out --epochs 3",
    "the former spelling of slip trials": "evaluate slip-trials --data pours",
    "bf16 in an engine without": "reproduce transition-tables --data pours --precision bf16",
    "a head that is not": "train-monitor pours --head gru --output out.taxel --cache cache",
    "windows of one frame": "train-monitor pours --frames 1 --output out.taxel --cache cache",
    "live without a bundle": "live none.taxel sim://cup-pour",
    "live of an address that is not": "live none.taxel sim://cup-poor",
    "a simulated set of no cups": "simulate cup-pour --cups 0 --output out",
    "a moment after the recording": "view pour.mcap --at 99 --png out.png",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_one_plain_line_exit_code_2_and_nothing_written(
    name: str, world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(world)
    monkeypatch.setenv("TAXEL_CACHE", str(world / "cache"))
    before = files(world)

    with pytest.raises(SystemExit) as ended:
        main(CASES[name].split())

    lines = capsys.readouterr().err.strip().splitlines()
    assert ended.value.code == 2
    assert len(lines) == 1, lines
    assert files(world) == before


def test_camera_trials_given_to_train_say_which_options_train_trials_lacks(
    world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(world)
    with pytest.raises(SystemExit) as ended:
        main(["train", "one.csv", "--minutes", "0.2", "--max-mb", "3", "--seed", "1", "--no-check"])
    message = capsys.readouterr().err
    assert ended.value.code == 2
    assert "options of taxel train-trials, which takes camera trials" in message
    assert "got --minutes and --max-mb, which it does not have" in message


def test_an_option_of_camera_trials_is_no_former_spelling_before_them(
    world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`evaluate` had --cache before; for camera trials it is evaluate-trials, which has it."""
    monkeypatch.chdir(world)
    for words, message in (
        ("evaluate one.csv --cache cache", "outcome"),
        ("evaluate one.csv --rule gross-slip", "taxel reproduce grasp-warnings --rule"),
        ("evaluate nothing --cache cache", "taxel reproduce grasp-warnings --cache"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(words.split())
        line = capsys.readouterr().err
        assert ended.value.code == 2
        assert message in line
        assert ("former spelling" in line) == ("reproduce" in message)


def files(world: Path) -> list[str]:
    """Return what lies in the folder, but for the cache, which may grow."""
    found = (path for path in world.rglob("*") if "cache" not in path.relative_to(world).parts)
    return sorted(str(path) for path in found)


def test_a_bundle_of_another_kind_is_sent_to_its_own_verb(
    world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(world)
    monkeypatch.setattr("taxel.bundles.envelope.kind_of", lambda path: "array")
    with pytest.raises(SystemExit) as ended:
        main(["evaluate-trials", "a.taxel", "one.csv"])
    assert ended.value.code == 2
    assert "another kind; run: taxel evaluate a.taxel one.csv." in capsys.readouterr().err


def test_an_option_that_would_change_nothing_is_named_as_it_was_typed(
    refused: Callable[[list[str]], str],
) -> None:
    line = refused(["evaluate-trials", "a.taxel", "one.csv", "--no-network"])
    assert "got --no-network, which would change nothing; leave it out" in line


def test_the_same_images_are_not_trained_on_and_tested_on(
    tmp_path: Path, refused: Callable[[list[str]], str]
) -> None:
    """Under another name in a second table they gave an accuracy of 1 to noise."""
    rng = np.random.default_rng(0)
    for n in range(6):
        np.save(tmp_path / f"t{n}.npy", rng.integers(0, 255, (9, 24, 32, 3), np.uint8))
    for name, own in (("train", range(6)), ("test", (4, 5))):
        lines = ["camera:a,label:kind", *(f"t{n}.npy,{'pq'[n % 2]}" for n in own)]
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")

    line = refused(["evaluate-trials", str(tmp_path / "train.csv"), "--test",
                    str(tmp_path / "test.csv"), "--cache", str(tmp_path / "c")])  # fmt: skip

    assert "other trials to test on than to train on" in line
    assert "holds the images of" in line


def two_cameras(folder: Path, name: str, head: str, order: str) -> Path:
    """Write a table of six trials, whose files are there once, with the cameras' files in order."""
    rng = np.random.default_rng(0)
    lines = [f"{head},label:kind"]
    for n in range(6):
        for side in "ab":
            np.save(folder / f"{side}{n}.npy", rng.integers(0, 255, (9, 24, 32, 3), np.uint8))
        lines.append(",".join([*(f"{side}{n}.npy" for side in order), "pq"[n % 2]]))
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder / f"{name}.csv"


@pytest.mark.parametrize("imported", [(), ("test",), ("train", "test")])
def test_nor_are_the_same_images_with_the_cameras_swapped(
    tmp_path: Path, refused: Callable[[list[str]], str], imported: tuple[str, ...]
) -> None:
    """A table with the files of left and right in each other's columns was taken for new trials."""
    data = {name: two_cameras(tmp_path, name, "left,right", order)
            for name, order in (("train", "ab"), ("test", "ba"))}  # fmt: skip
    for name in imported:
        main(["import", str(data[name]), "--output", str(tmp_path / name)])
        data[name] = tmp_path / name

    line = refused(["evaluate-trials", str(data["train"]), "--test", str(data["test"]),
                    "--cache", str(tmp_path / "c")])  # fmt: skip

    assert "other trials to test on than to train on" in line
    assert "holds the images of 0001-a0" in line


def test_cameras_in_another_order_are_refused_beside_these(
    tmp_path: Path, refused: Callable[[list[str]], str]
) -> None:
    """A recogniser knows cameras by their place: it saw the left one's images as the right's."""
    train = two_cameras(tmp_path, "train", "left,right", "ab")
    test = two_cameras(tmp_path, "test", "right,left", "ab")

    line = refused(["evaluate-trials", str(train), "--test", str(test),
                    "--cache", str(tmp_path / "c")])  # fmt: skip

    assert "cameras in one order" in line
    assert "left, right in 0001-a0 and right, left in 0001-a0" in line


@pytest.mark.parametrize(("data", "test"), [("train.csv", "rec"), ("rec", "train.csv")])
def test_nor_are_recordings_that_were_imported_from_them(
    tmp_path: Path, refused: Callable[[list[str]], str], data: str, test: str
) -> None:
    rng = np.random.default_rng(0)
    lines = ["camera:a,label:kind"]
    for n in range(4):
        np.save(tmp_path / f"t{n}.npy", rng.integers(0, 255, (9, 24, 32, 3), np.uint8))
        lines.append(f"t{n}.npy,{'pq'[n % 2]}")
    (tmp_path / "train.csv").write_text("\n".join(lines) + "\n")
    main(["import", str(tmp_path / "train.csv"), "--output", str(tmp_path / "rec")])

    line = refused(["evaluate-trials", str(tmp_path / data), "--test", str(tmp_path / test),
                    "--cache", str(tmp_path / "c")])  # fmt: skip

    assert "holds the images of 0001-t0" in line


@pytest.mark.parametrize(
    ("public", "line"),
    [("", "import it: taxel import trials.csv --output recordings"),
     ("a-set", "import it: taxel import a-set --data {path} --output recordings")],
)  # fmt: skip
@pytest.mark.parametrize("page", [[], ["--page"]])
@pytest.mark.parametrize("source", ["{path}", "replay://{path}?speed=max"])
def test_a_monitor_says_how_a_folder_of_videos_becomes_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    page: list[str], source: str, public: str, line: str,
) -> None:  # fmt: skip
    """The line was: name one of its files; which are no recordings either."""
    (tmp_path / "a.avi").touch()
    monkeypatch.setattr(camera_trials, "known_videos", lambda _: public)
    with pytest.raises(SystemExit):
        main(["live", "slip-both-gels", source.format(path=tmp_path), *page])
    printed = " ".join(capsys.readouterr().err.split())
    assert "images or videos alone" in printed
    assert line.format(path=tmp_path) in printed


@pytest.mark.parametrize(
    "words",
    [
        "info {0}", "view {0}/cup/a.mp4", "train {0}", "import {0} --output out",
        "import {0}/cup/a.mp4 --output out",
    ],
)  # fmt: skip
def test_videos_in_place_of_recordings_or_a_table_are_answered_with_the_table_to_write(
    words: str, tmp_path: Path, refused: Callable[[list[str]], str]
) -> None:
    """Not with the pattern for arrays, nor with a text in a wrong encoding."""
    (tmp_path / "videos" / "cup").mkdir(parents=True)
    (tmp_path / "videos" / "cup" / "a.mp4").write_bytes(b"\0\0\0 ftypisom\xa9" + bytes(90))

    line = refused(words.format(tmp_path / "videos").split())

    assert "name them in a table trials.csv: first line camera:NAME,label:NAME" in line


def test_a_run_in_place_of_recordings_is_answered_with_its_page(
    tmp_path: Path, refused: Callable[[list[str]], str]
) -> None:
    (tmp_path / "run.json").write_text("{}")
    line = refused(["info", str(tmp_path)])
    assert f"for this run, a page: taxel report {tmp_path} --output run.html" in line


def test_a_pattern_in_a_table_of_videos_is_answered_with_a_row_for_each_trial(
    tmp_path: Path, refused: Callable[[list[str]], str]
) -> None:
    table = tmp_path / "trials.csv"
    table.write_text("camera:top,label:object\n{label:object}/*.mp4,\n")
    line = refused(["train-trials", str(table)])
    assert "line 2; write a row for each trial: in tables of videos no cell stands for" in line


@pytest.mark.parametrize(
    ("bundle", "mend"),
    [
        ("run", "got run, a run; name run/recogniser.taxel"),
        ("none.taxel", "which is not there; name recogniser.taxel in a run of taxel train-trials"),
        ("slip-both-gels.taxel", "which is not there; name slip-both-gels"),
        ("more.csv", "got more.csv, which is no bundle, and trials.csv; leave one out"),
    ],
)
def test_a_bundle_of_camera_trials_that_is_none_is_answered_with_the_file_to_name(
    bundle: str, mend: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    refused: Callable[[list[str]], str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("run").mkdir()
    Path("run/recogniser.taxel").touch()
    for name in ("trials.csv", "more.csv"):
        Path(name).write_text("camera:top,label:object\na.mp4,cup\n")

    assert mend in refused(["evaluate-trials", bundle, "trials.csv"])
