"""Claims about LeRobot's layout: written right, read by LeRobot where it is, back bit by bit."""

import importlib
import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset, BadInput
from taxel.exchange import episodes
from taxel.recordings.reader import iterate_frames, iterate_jpeg, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Validity
from taxel.sim.pour.state import TRUTH_CHANNELS

pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (taxel[export])")
layout = importlib.import_module("taxel.exchange.lerobot_layout")
problems = importlib.import_module("lerobot_check").problems
import_lerobot = importlib.import_module("taxel.exchange.lerobot_read").import_lerobot
lerobot_stats = importlib.import_module("taxel.exchange.lerobot_stats")
write_lerobot = importlib.import_module("taxel.exchange.lerobot_write").write_lerobot
DATA = "data/chunk-000/file-000.parquet"


@pytest.fixture
def recordings(make, tmp_path) -> list[Path]:
    return [make(tmp_path / f"r{seed}.mcap", seed=seed) for seed in (1, 2)]


def check_same(before: Path, after: Path) -> None:
    """Values, flags, times, images, labels, groups and marks are the same, bit by bit."""
    ours, theirs = read_recording(before), read_recording(after)
    assert theirs.manifest == ours.manifest
    assert theirs.marks == ours.marks
    assert theirs.samples.values.tobytes() == ours.samples.values.tobytes()
    np.testing.assert_array_equal(theirs.samples.validity, ours.samples.validity)
    np.testing.assert_array_equal(theirs.samples.fitted_s, ours.samples.fitted_s)
    np.testing.assert_array_equal(theirs.samples.counter, ours.samples.counter)
    for camera in range(len(ours.manifest.cameras)):  # cameras mix as chunks were flushed
        frames = [
            [(f.jpeg, f.fitted_s, f.counter) for f in iterate_frames(path, camera)]
            for path in (before, after)
        ]
        assert frames[0] == frames[1]


@pytest.mark.parametrize(("array", "cameras"), [(True, True), (True, False), (False, True)])
def test_there_and_back_again_nothing_changed(array, cameras, make, tmp_path):
    """JPEG, values, flags, exact times, labels, groups and marks."""
    kind = {"array": array, "cameras": cameras, "seconds": 1.6 if cameras else 1.603}
    paths = [make(tmp_path / f"r{seed}.mcap", seed=seed, **kind) for seed in (1, 2)]
    written = write_lerobot(paths, tmp_path / "set")
    assert (written.scans_left_out, written.images_left_out) == (0, 0)
    assert problems(tmp_path / "set") == []
    back = import_lerobot(tmp_path / "set", tmp_path / "back")
    assert [path.name for path in back] == [path.name for path in paths]
    for before, after in zip(paths, back, strict=True):
        check_same(before, after)


def test_windows_hold_the_scans_up_to_their_frame(recordings, tmp_path):
    """No frame sees a scan of its future; what never was is NaN and MISSING, not zero."""
    write_lerobot(recordings, tmp_path / "set", rows=44)
    table = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    ours = read_recording(recordings[0]).samples
    frames = list(iterate_frames(recordings[0], 0))
    for place in (0, 1, 20, 39):
        end = int(np.searchsorted(ours.fitted_s, frames[place].fitted_s, "right"))
        window = np.array(table[layout.TACTILE][place].as_py(), np.float32)
        flags = np.array(table[layout.TOUCH.validity][place].as_py())
        missing = max(0, 44 - end)
        np.testing.assert_array_equal(window[missing:], ours.values[max(0, end - 44) : end])
        assert np.isnan(window[:missing]).all()
        assert (flags[:missing] == 1).all()
        assert table[layout.STATE][place].as_py() == window[-1].tolist()
    assert len(frames) == 40


def test_a_simulators_truth_is_no_observation_and_comes_back_the_same(make, tmp_path):
    """Slip as the simulator knows it is under truth, where no policy of LeRobot's looks."""
    path = make(tmp_path / "pour.mcap", channels=(*TRUTH_CHANNELS, "shift"))
    written = write_lerobot([path], tmp_path / "set")
    assert written.truth == (*TRUTH_CHANNELS, "shift")
    features = json.loads((tmp_path / "set" / layout.INFO).read_text("utf-8"))["features"]
    seen = [key for key in features if key.startswith("observation")]
    assert seen == ["observation.images.left", "observation.images.right"]
    assert features["truth.state"]["names"] == [*TRUTH_CHANNELS, "shift"]
    assert problems(tmp_path / "set") == []
    (back,) = import_lerobot(tmp_path / "set", tmp_path / "back")
    check_same(path, back)


def test_truth_without_cameras_comes_back_the_same(make, tmp_path):
    path = make(tmp_path / "pour.mcap", channels=TRUTH_CHANNELS, cameras=False, seconds=1.603)
    write_lerobot([path], tmp_path / "set")
    (back,) = import_lerobot(tmp_path / "set", tmp_path / "back")
    check_same(path, back)


def test_what_is_missing_does_not_scale_what_is_there(make, tmp_path):
    """A lost scan is recorded as 0 V with a flag; a dead channel has no value in its episode."""
    first, second = tmp_path / "a.mcap", tmp_path / "b.mcap"
    sound = read_recording(make(tmp_path / "sound.mcap", cameras=False))
    for path, dead in ((first, np.s_[100:700]), (second, np.s_[:])):
        values, validity = sound.samples.values + 5, sound.samples.validity.copy()
        values[dead, 2], validity[dead, 2] = 0, Validity.MISSING
        with Recorder(path, sound.manifest) as recorder:
            recorder.write(replace(sound.samples, values=values, validity=validity))
    write_lerobot([first, second], tmp_path / "set", rows=40)
    stats = json.loads((tmp_path / "set" / layout.STATS).read_text(encoding="utf-8"))

    left = np.r_[0:100, 700:1600]
    known = np.asarray(sound.samples.values + 5)[left, 2]
    window = {name: np.array(found) for name, found in stats[layout.TACTILE].items()}
    assert window["min"][:, 2].min() == known.min()
    assert window["max"][:, 2].max() == known.max()
    np.testing.assert_allclose(window["mean"][:, 2].mean(), known.mean(), rtol=1e-5)
    state = stats[layout.STATE]
    assert 5 <= state["min"][2] <= state["q01"][2] <= state["mean"][2] <= state["max"][2]
    assert state["std"][2] < 0.5
    assert state["count"] == [80]


def test_a_channel_that_is_never_there_has_statistics_of_zero():
    dead = lerobot_stats.stats_of(np.full((4, 1), np.nan))
    assert np.all([dead[name] == 0 for name in ("min", "max", "mean", "std", "q50")])
    both = lerobot_stats.as_lists(lerobot_stats.together([dead, dead]))
    assert (both["min"], both["max"], both["mean"], both["count"]) == ([0], [0], [0], [8])


def test_labels_are_tasks_and_groups_are_columns(recordings, tmp_path):
    written = write_lerobot(recordings, tmp_path / "set")
    assert written.tasks == [
        "shape: sphere", "grasp: stable, shape: sphere", "grasp: slip, shape: sphere"
    ]  # fmt: skip
    rows = pq.read_table(tmp_path / "set" / layout.EPISODES).to_pylist()
    assert [row["taxel/group/session"] for row in rows] == ["1", "2"]
    assert {row["taxel/label/shape"] for row in rows} == {"sphere"}


def test_marks_may_be_the_episodes(recordings, tmp_path):
    """Each labelled stretch, with its own labels and groups, and no scan of another."""
    written = write_lerobot(recordings, tmp_path / "set", cut="mark")
    assert written.episodes == 4
    assert problems(tmp_path / "set") == []
    back = import_lerobot(tmp_path / "set", tmp_path / "back")
    first = read_recording(back[0])
    assert first.manifest.labels == {"shape": "sphere", "grasp": "stable"}
    assert first.manifest.groups == {"session": "1", "cup": "ä"}
    assert first.marks == []
    assert 100.2 <= first.samples.fitted_s[0] <= first.samples.fitted_s[-1] <= 100.6


def test_where_no_recording_has_a_mark_it_is_marks_that_are_asked_for(make, tmp_path):
    manifest = read_recording(make(tmp_path / "a.mcap", cameras=False)).manifest
    with Recorder(tmp_path / "b.mcap", manifest) as recorder:
        recorder.write(read_recording(tmp_path / "a.mcap").samples)
    with pytest.raises(BadDataset, match="with marks to cut it at; got none"):
        write_lerobot([tmp_path / "b.mcap"], tmp_path / "set", cut="mark")


def test_images_before_a_mark_are_not_held(make, tmp_path, monkeypatch):
    """An hour's images do not fit into memory."""
    alive = [0, 0]

    class Counted(bytes):
        def __del__(self) -> None:
            alive[0] -= 1

    def counted(path):
        for frame in iterate_jpeg(path):
            yield replace(frame, jpeg=Counted(frame.jpeg))
            alive[0] += 1
            alive[1] = max(alive)

    monkeypatch.setattr(episodes, "iterate_jpeg", counted)
    path = make(tmp_path / "a.mcap")
    rhythm = episodes.rhythm_of(read_recording(path).manifest, path, None, None)
    _, late = episodes.episodes_of(path, rhythm, "mark")
    alive[:] = [0, 0]
    assert len(list(map(len, late.frames()))) == len(late)
    assert alive[1] < 8


@pytest.mark.parametrize(("what", "mend"), [("array", "import it again"), ("camera", "--fps")])
def test_a_rate_that_is_not_known_is_asked_for_where_it_can_be_given(what, mend, make, tmp_path):
    manifest = read_recording(make(tmp_path / "a.mcap")).manifest
    unknown = {
        "array": replace(manifest, sensor=replace(manifest.sensor, rate_hz=0.0)),
        "camera": replace(manifest, cameras=(replace(manifest.cameras[0], rate_hz=0.0),)),
    }[what]
    with pytest.raises(BadDataset, match=f"{what} has a rate.*{mend}"):
        episodes.rhythm_of(unknown, tmp_path / "a.mcap", None, None)


def test_lost_images_and_scans_are_counted(make, tmp_path):
    """What fits no frame is said, never dropped in silence."""
    path = make(tmp_path / "a.mcap")
    written = write_lerobot([path], tmp_path / "set", rows=20)
    assert written.scans_left_out > 500


@pytest.mark.parametrize("name", [layout.INFO, layout.EPISODES, layout.TASKS, DATA])
def test_a_damaged_data_set_is_refused_and_nothing_is_written(name, recordings, tmp_path):
    write_lerobot(recordings, tmp_path / "set")
    file = tmp_path / "set" / name
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(BadDataset) as caught:
        import_lerobot(tmp_path / "set", tmp_path / "back")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "back").exists()


@pytest.mark.parametrize("name", [layout.EPISODES, layout.TASKS])
@pytest.mark.parametrize("kind", ["rows", "texts", "nothing"])
def test_what_packs_too_well_is_refused_before_it_is_unpacked(
    name, kind, recordings, tmp_path, monkeypatch
):
    """A million equal rows are a few hundred bytes of Parquet, and so is a text, said as often."""
    pa = importlib.import_module("pyarrow")
    write_lerobot(recordings, tmp_path / "set")
    rows = 1_000_001 if kind == "rows" else 64
    empty = pa.nulls(rows, pa.int64()) if kind == "nothing" else pa.array([0] * rows)
    held = {"episode_index": empty, "task_index": empty}
    if kind == "texts":
        held["task"] = pa.DictionaryArray.from_arrays(
            pa.array([0] * rows, pa.int32()), ["a" * 10_000]
        )
        monkeypatch.setattr("taxel.exchange.lerobot_read._LARGEST_META", 100_000)
        monkeypatch.setattr("taxel.exchange.lerobot_read._AT_ONCE", 20_000)
    pq.write_table(pa.table(held), tmp_path / "set" / name, store_schema=False)
    assert (tmp_path / "set" / name).stat().st_size < 20_000
    message = {
        "rows": "1,000,001 rows",
        "texts": "more than 100,000 bytes",
        "nothing": "TypeError",
    }[kind]
    with pytest.raises(BadDataset, match=message) as caught:
        import_lerobot(tmp_path / "set", tmp_path / "back")
    assert "\n" not in str(caught.value)


def only(key: str, dtype: str) -> dict[str, dict]:
    return {"features": {key: {"dtype": dtype, "shape": [4, 4, 3], "names": None}}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"codebase_version": "v2.1"}, "v3.0"),
        ({"storage_format": "lance"}, "lance"),
        (only("observation.images.x", "video"), "video"),
        (only("action", "float32"), "none of them"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(change, message, recordings, tmp_path):
    write_lerobot(recordings, tmp_path / "set")
    file = tmp_path / "set" / layout.INFO
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(BadDataset, match=message):
        import_lerobot(tmp_path / "set", tmp_path / "back")


def test_somebody_elses_data_set_gives_state_and_images_at_frame_over_fps(recordings, tmp_path):
    """Without taxel's columns: times are frame / fps, and tasks become labels."""
    write_lerobot(recordings, tmp_path / "set")
    place = tmp_path / "set" / layout.EPISODES
    table = pq.read_table(place)
    own = [name for name in table.column_names if name.startswith(layout.OWN)]
    pq.write_table(table.drop_columns(own), place)
    back = import_lerobot(tmp_path / "set", tmp_path / "back")
    assert [path.stem for path in back] == ["episode_000000", "episode_000001"]
    recording = read_recording(back[0])
    assert recording.manifest.sensor.details["time"] == "frame number over rate"
    assert recording.marks[0].labels == {"task": "shape: sphere"}
    frames = list(iterate_frames(back[0], 0))
    assert [f.fitted_s for f in frames] == pytest.approx([k / 25 for k in range(40)])
    assert (
        frames[3].jpeg == next(f for f in iterate_frames(recordings[0], 0) if f.counter == 3).jpeg
    )


def test_tasks_are_found_by_their_numbers_and_not_by_their_places(recordings, tmp_path):
    """In a part of a data set, whose tasks have numbers between left out, frames got others'."""
    pa = importlib.import_module("pyarrow")
    write_lerobot(recordings, tmp_path / "set")
    place = tmp_path / "set" / layout.EPISODES
    table = pq.read_table(place)
    own = [name for name in table.column_names if name.startswith(layout.OWN)]
    pq.write_table(table.drop_columns(own), place)
    for numbers, refused in (((2, 0, 1), False), ((0, 7, 8), True)):
        tasks = pa.table({"task_index": list(numbers), "task": ["c", "a", "b"]})
        pq.write_table(tasks, tmp_path / "set" / layout.TASKS)
        if refused:
            with pytest.raises(BadDataset, match="task 1 of a frame is not among the tasks"):
                import_lerobot(tmp_path / "set", tmp_path / "none")
        else:
            back = import_lerobot(tmp_path / "set", tmp_path / "back")
            found = {mark.labels["task"] for mark in read_recording(back[0]).marks}
            assert found == {"a", "b", "c"}


@pytest.mark.parametrize("names", [["channels", "height", "width"], None, "absent"])
def test_somebody_elses_images_may_have_their_channels_first(names, recordings, tmp_path):
    write_lerobot(recordings, tmp_path / "set")
    place = tmp_path / "set" / layout.EPISODES
    table = pq.read_table(place)
    own = [name for name in table.column_names if name.startswith(layout.OWN)]
    pq.write_table(table.drop_columns(own), place)
    file = tmp_path / "set" / layout.INFO
    info = json.loads(file.read_text())
    for side in ("left", "right"):
        feature = info["features"][f"observation.images.{side}"]
        feature |= {"shape": [3, 24, 32], "names": names}
        if names == "absent":
            del feature["names"]
    file.write_text(json.dumps(info))

    back = import_lerobot(tmp_path / "set", tmp_path / "back")
    cameras = read_recording(back[0]).manifest.cameras
    assert [(camera.width, camera.height) for camera in cameras] == [(32, 24)] * 2


def test_different_arrays_do_not_make_a_data_set(make, recordings, tmp_path):
    other = make(tmp_path / "z.mcap", array=False)
    with pytest.raises(BadDataset, match="same array"):
        write_lerobot([*recordings, other], tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_a_rate_follows_from_the_other_where_there_are_no_cameras(make, tmp_path):
    path = make(tmp_path / "a.mcap", cameras=False)
    assert write_lerobot([path], tmp_path / "a", rows=20).fps == 50
    assert write_lerobot([path], tmp_path / "b", fps=100).rows == 10
    with pytest.raises(BadInput, match="leave one out"):
        write_lerobot([path], tmp_path / "c", fps=100, rows=5)


def test_nothing_but_an_older_data_set_is_replaced(recordings, tmp_path):
    (tmp_path / "set").mkdir()
    (tmp_path / "set/mine.txt").write_text("mine")
    with pytest.raises(BadInput, match="which is another"):
        write_lerobot(recordings, tmp_path / "set", overwrite=True)
    (tmp_path / "set/mine.txt").unlink()
    write_lerobot(recordings, tmp_path / "set")
    with pytest.raises(BadInput, match="which exists"):
        write_lerobot(recordings, tmp_path / "set")
    write_lerobot(recordings[:1], tmp_path / "set", overwrite=True)
    assert problems(tmp_path / "set") == []


def test_the_check_finds_what_is_wrong(recordings, tmp_path):
    """Our own check of the layout can fail: each of these would mislead LeRobot."""
    write_lerobot(recordings, tmp_path / "set")
    file = tmp_path / "set" / layout.INFO
    info = json.loads(file.read_text())
    file.write_text(json.dumps(info | {"fps": 30, "total_frames": 7}))
    found = "\n".join(problems(tmp_path / "set"))
    assert "timestamp is not frame over fps" in found
    assert "7 in info" in found


@pytest.mark.skipif(
    importlib.util.find_spec("lerobot") is None,
    reason="lerobot is not installed (Python 3.12; docs/how-to/lerobot.md has the recipe)",
)
def test_lerobots_own_reader_loads_it(recordings, tmp_path):
    """Their reader, their time windows and a DataLoader, offline."""
    import torch
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    write_lerobot(recordings, tmp_path / "set")
    windows = {layout.STATE: [-0.04, 0.0]}
    data = LeRobotDataset("taxel/test", root=tmp_path / "set", delta_timestamps=windows)
    batches = list(torch.utils.data.DataLoader(data, batch_size=16))
    assert sum(len(batch["index"]) for batch in batches) == len(data) == 80
    assert batches[0][layout.TACTILE].shape == (16, 44, 3)
    assert batches[0][layout.STATE].shape == (16, 2, 3)
    assert batches[0]["observation.images.left"].shape == (16, 3, 24, 32)


def test_scans_a_frame_are_refused_where_there_is_no_array(make, tmp_path):
    """--rows was taken without a word, and changed nothing."""
    path = make(tmp_path / "a.mcap", array=False)
    with pytest.raises(BadInput, match=r"an array beside --rows.* of cameras alone; leave it out"):
        write_lerobot([path], tmp_path / "set", rows=4)
    assert not (tmp_path / "set").exists()
