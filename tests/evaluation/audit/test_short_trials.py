"""Claims about trials that are too short for an audit: a refusal that they cause names them."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset
from taxel.evaluation.audit.reading import read_touch
from taxel.frame_codec import encode_jpeg
from taxel.recordings.imports.importing import import_table
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame


def test_where_all_trials_of_a_class_are_too_short_the_refusal_says_so(tmp_path: Path) -> None:
    """The recordings have two classes: "label the recordings" alone would mislead."""
    (tmp_path / "a.csv").write_text("x\n" + "".join(f"{i % 7}\n" for i in range(100)))
    (tmp_path / "t.csv").write_text("file,channels,time\na.csv,x[N],rate:10Hz\n")
    (tmp_path / "i.csv").write_text(
        "start_s,end_s,label:outcome\n0,1,held\n2,3,held\n4,5,held\n6,6.1,slip\n7,7.1,slip\n"
    )
    import_table(tmp_path / "t.csv", tmp_path / "set", intervals=tmp_path / "i.csv")

    with pytest.raises(BadDataset, match=r"outcome; 2 trials of fewer than 3 rows: left out"):
        read_touch(tmp_path / "set", None, lambda *_: None)


def test_recordings_of_a_still_camera_are_not_called_short(tmp_path: Path) -> None:
    """They have eight frames each; of those that repeat, the audit looks at the first."""
    image = np.zeros((24, 32, 3), np.uint8)
    image[:, :, 0] = 200
    camera = CameraInfo(name="gel", width=32, height=24, rate_hz=25.0)
    for number in range(2):
        manifest = Manifest(sensor=NO_ARRAY, cameras=(camera,), labels={"kind": f"{number}"})
        with Recorder(tmp_path / f"{number}.mcap", manifest) as recorder:
            for i in range(8):
                at_s = i / 25
                recorder.frame(Frame(camera=0, jpeg=encode_jpeg(image), counter=i, device_s=at_s,
                                     arrival_s=at_s, fitted_s=at_s))  # fmt: skip

    with pytest.raises(BadDataset, match="trials of at least 3 different frames"):
        read_touch(tmp_path, None, lambda *_: None)
