"""Claims about the channels of somebody else's LeRobot data set: names of their own, or numbers."""

import pytest

pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")


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
    from taxel.exchange.lerobot_episode import ForeignEpisode, Info
    from taxel.foreign.json_text import Fields

    feature = Fields({"dtype": "float32", "shape": [3], "names": names}, "a feature")
    episode = ForeignEpisode(
        Info(30, {"observation.state": feature}), {"episode_index": 0, "tasks": []}, {}
    )
    assert episode.manifest.sensor.channels == channels
