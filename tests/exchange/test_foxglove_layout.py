"""The layout for Foxglove looks at what is in the recording, and its map's script draws it."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from mcap.reader import make_reader

from taxel.exchange.foxglove_layout import MAP_TOPIC, layout_of, map_script, paths_of
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import read_manifest
from taxel.recordings.scan_layout import MOST_NAMED
from taxel.signals import SensorInfo


def test_every_path_of_the_layout_is_in_the_recording(make, tmp_path):
    """A topic of the file, and a field of its schema; only slip and the map are made elsewhere."""
    path = make(tmp_path / "a.mcap")
    layout = layout_of(read_manifest(path))
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    channels = summary.channels.values()
    schemas = {c.topic: summary.schemas[c.schema_id].data.decode() for c in channels}
    looked_at = [p for p in paths_of(layout) if not p.startswith((MAP_TOPIC, "/slip"))]
    assert len(looked_at) == 3 + 2 + 2
    for value in looked_at:
        topic, *fields = value.split(".")
        for field in fields:
            name = field.partition("[")[0]
            assert re.search(rf"\b{name}\b", schemas[topic]), value
    labels = [p["label"] for p in layout["configById"]["Plot!0"]["paths"]]
    assert labels == ["thumb (V)", "index (V)", "palm (V)"]


def test_every_panel_has_a_place(make, tmp_path):
    """Each panel stands once in the arrangement; both images, the map, plots and states."""
    layout = layout_of(read_manifest(make(tmp_path / "a.mcap")))
    placed = re.findall(r'"((?:Plot|Image|StateTransitions)![^"]*)"', json.dumps(layout["layout"]))
    assert sorted(placed) == sorted(layout["configById"])
    assert {"Image!left", "Image!right", "Image!map", "StateTransitions!states"} < set(placed)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_maps_script_draws_each_channel_and_what_is_missing(make, tmp_path):
    """Run as the viewer runs it, but for its types: grey by value, violet where missing."""
    source = map_script(read_manifest(make(tmp_path / "a.mcap")))
    plain = re.sub(r"import .*\n|export const|export default| as unknown as [^;]*", "", source)
    plain = re.sub(r"^ (inputs|output) =", r"const \1 =", plain, flags=re.M)
    plain = re.sub(r"script\(event: .*\): .* \{", "script(event) {", plain)
    message = {"values": {"thumb_v": 3.3, "index_v": 1.65, "palm_v": 1.0}, "validity": [0, 4, 1]}
    event = json.dumps({"message": message})
    call = f"console.log(JSON.stringify(Array.from(script({event}).data)))"
    run = subprocess.run(["node", "-e", plain + call], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    pixels = np.array(json.loads(run.stdout)).reshape(4, 3)
    assert pixels.tolist() == [[255] * 3, [128] * 3, [128, 0, 128], [0, 0, 0]]


def test_a_large_skin_without_cameras_has_a_layout_of_its_states():
    """More channels than a viewer shows by name: neither a plot nor a map is left."""
    names = tuple(map(str, range(MOST_NAMED + 1)))
    skin = SensorInfo(name="skin", channels=names, units=("V",) * len(names), rate_hz=100.0)
    layout = layout_of(Manifest(sensor=skin))

    assert list(layout["configById"]) == [layout["layout"]]
    assert "/marks.labels[0].value" in paths_of(layout)
