"""Claims about the scans of somebody else's LeRobot data set: their channels and tasks."""

import importlib

import pytest

from taxel.foreign.json_text import Fields

pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")
lerobot_episode = importlib.import_module("taxel.exchange.lerobot_episode")
ForeignEpisode, Info = lerobot_episode.ForeignEpisode, lerobot_episode.Info


@pytest.mark.parametrize(
    ("names", "channels"),
    [
        (["a", "b", "c"], ("a", "b", "c")),
        ({"motors": ["a", "b", "c"]}, ("a", "b", "c")),
        ({"left": ["a"], "right": ["b", "c"]}, ("0", "1", "2")),
        (["a", "b"], ("0", "1", "2")),
        (["x", "y", "x"], ("0", "1", "2")),
        (["x", "y", ""], ("0", "1", "2")),
        (None, ("0", "1", "2")),
    ],
)
def test_channels_have_names_of_their_own(names, channels):
    """Those that LeRobot keeps as {"motors": […]} were lost, and two could be called alike."""
    feature = Fields({"dtype": "float32", "shape": [3], "names": names}, "a feature")
    episode = ForeignEpisode(
        Info(30, {"observation.state": feature}), {"episode_index": 0, "tasks": []}, {}
    )
    assert episode.manifest.sensor.channels == channels


@pytest.mark.parametrize("rows", [1, 4])
def test_all_scans_of_a_frame_belong_to_its_task(rows):
    """Half of those that come before a task's first frame counted as the task before."""
    feature = Fields({"dtype": "float32", "shape": [rows, 1], "names": None}, "a feature")
    words = {0: "press", 1: "slide"}
    episode = ForeignEpisode(
        Info(25, {"observation.tactile": feature}),
        {"episode_index": 0, "tasks": list(words.values())}, words,
    )  # fmt: skip
    tasks = [0, 0, 0, 1, 1]
    values = pa.array([[[float(task)]] * rows for task in tasks])
    part = pa.RecordBatch.from_pydict(
        {"observation.tactile": values, "frame_index": list(range(5)), "task_index": tasks}
    )
    (samples,) = episode.items(part)
    marks = episode.marks
    assert [mark.labels["task"] for mark in marks] == ["press", "slide"]
    for mark, value, count in zip(marks, (0.0, 1.0), (3 * rows, 2 * rows), strict=True):
        inside = (samples.fitted_s >= mark.start_s) & (samples.fitted_s <= mark.end_s)
        assert samples.values[inside, 0].tolist() == [value] * count
