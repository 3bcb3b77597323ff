"""A layout for Foxglove and Lichtblick: a recording's channels by name, its images, map and states.

The map is made in the viewer by a short script of the layout: a pixel a channel, from black to
white up to the full scale, violet where a value is missing. Knows nothing about the viewer's files
beyond the layout.

Source: layouts that Lichtblick 1.2 exports, and its panels' settings. Background:
docs/decisions/0051.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taxel.errors import BadInput
from taxel.recordings.field_names import field_names
from taxel.recordings.frame_layout import frame_topic
from taxel.recordings.manifest import Manifest
from taxel.recordings.mark_layout import MARK_TOPIC
from taxel.recordings.scan_layout import MOST_NAMED, scan_topic
from taxel.recordings.slip_layout import SLIP_TOPIC
from taxel.recordings.whole import write_whole
from taxel.signals import UNUSABLE

A_PLOT = 12
"""Channels in a plot; more make a further one. Source: our choice: distinct colours."""
_MOST_PLOTS = 4
"""Of an array; further channels are shown in its image alone. Source: our choice."""
MAP_TOPIC = "/taxel/map"

_SCRIPT = """\
// The array as an image: a pixel a channel, black to white, violet where a value is missing.
import {{ Input, Message }} from "./types";

export const inputs = [{topic}];
export const output = {output};
const FIELDS = {fields};
const [WIDTH, HEIGHT, FULL] = [{width}, {height}, {full}];
const UNUSABLE = {unusable};

export default function script(event: Input<{topic}>): Message<"foxglove.RawImage"> {{
  const values = event.message.values as unknown as Record<string, number>;
  const data = new Uint8Array(3 * WIDTH * HEIGHT);
  FIELDS.forEach((name, i) => {{
    const missing = (event.message.validity[i] & UNUSABLE) !== 0 || Number.isNaN(values[name]);
    const level = Math.max(0, Math.min(255, Math.round((255 * values[name]) / FULL)));
    data.set(missing ? [128, 0, 128] : [level, level, level], 3 * i);
  }});
  return {{ timestamp: event.receiveTime, frame_id: "map", width: WIDTH, height: HEIGHT,
           encoding: "rgb8", step: 3 * WIDTH, data }};
}}
"""


def layout_of(manifest: Manifest) -> dict[str, Any]:
    """Return the layout of a recording as the viewers import it."""
    panels: dict[str, Any] = {}
    scripts: dict[str, Any] = {}
    columns: list[Any] = []
    plots = _plots(manifest)
    if plots:
        panels |= plots
        columns.append(_stack(list(plots), "column"))
    pictures = {
        f"Image!{camera.name}": _image(frame_topic(camera.name)) for camera in manifest.cameras
    }
    if 0 < len(manifest.sensor.channels) <= MOST_NAMED:
        pictures["Image!map"] = _image(MAP_TOPIC)
        scripts["taxel-map"] = {"name": "map", "sourceCode": map_script(manifest)}
    panels |= pictures
    if pictures:
        columns.append(_stack(list(pictures), "column"))
    panels["StateTransitions!states"] = _states(manifest)
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": scripts,
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "column", "splitPercentage": 80, "second": "StateTransitions!states",
            "first": _stack(columns, "row"),
        } if columns else "StateTransitions!states",
    }  # fmt: skip


def map_script(manifest: Manifest) -> str:
    """Return the script, in TypeScript, by which the viewer draws the array's map."""
    sensor = manifest.sensor
    width = math.ceil(math.sqrt(len(sensor.channels)))
    return _SCRIPT.format(
        topic=json.dumps(scan_topic(sensor.name)), output=json.dumps(MAP_TOPIC),
        fields=json.dumps(field_names(sensor.channels, sensor.units)), width=width,
        height=math.ceil(len(sensor.channels) / width), full=json.dumps(sensor.full_scale or 1.0),
        unusable=int(UNUSABLE),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Written:
    """What a layout holds."""

    panels: int
    shows: list[str]
    """Message paths and topics, see `paths_of`."""


def write_layout(path: Path, manifest: Manifest, *, overwrite: bool = False) -> Written:
    """Write the layout for recordings of one array and its cameras, whole or not at all.

    Raises:
        BadInput: There is such a file, and `overwrite` is not said.
        RecordingFailed: The disk refused.
    """
    if path.exists() and not overwrite:
        raise BadInput("a new file for the layout", f"{path}, which exists", "add --overwrite")
    layout = layout_of(manifest)
    write_whole(path, json.dumps(layout, indent=1, ensure_ascii=False).encode())
    return Written(len(layout["configById"]), paths_of(layout))


def paths_of(layout: dict[str, Any]) -> list[str]:
    """Return every message path and topic that a layout's panels look at."""
    found = []
    for panel in layout["configById"].values():
        found += [path["value"] for path in panel.get("paths", ())]
        if "imageMode" in panel:
            found.append(panel["imageMode"]["imageTopic"])
    return found


def _plots(manifest: Manifest) -> dict[str, Any]:
    sensor = manifest.sensor
    if not 0 < len(sensor.channels) <= MOST_NAMED:
        return {}
    names = field_names(sensor.channels, sensor.units)
    rows = list(zip(names, sensor.channels, sensor.units, strict=True))
    found = {}
    for first in range(0, min(len(rows), A_PLOT * _MOST_PLOTS), A_PLOT):
        paths = [
            _path(f"{scan_topic(sensor.name)}.values.{name}", f"{channel} ({unit})")
            for name, channel, unit in rows[first : first + A_PLOT]
        ]
        found[f"Plot!{first}"] = {
            "title": sensor.name, "paths": paths, "xAxisVal": "timestamp", "isSynced": True,
            "showLegend": True, "legendDisplay": "left", "showXAxisLabels": True,
            "showYAxisLabels": True, "sidebarDimension": 200,
        }  # fmt: skip
    return found


def _states(manifest: Manifest) -> dict[str, Any]:
    paths = [
        _path(f"{MARK_TOPIC}.labels[0].value", "label"),
        _path(f"{MARK_TOPIC}.labels[1].value", "second label"),
    ]
    if manifest.cameras:
        paths.append(_path(f"{SLIP_TOPIC}.slip_seen", "slip seen"))
    return {"isSynced": True, "paths": paths}


def _path(value: str, label: str) -> dict[str, Any]:
    return {"value": value, "label": label, "enabled": True, "timestampMethod": "receiveTime"}


def _image(topic: str) -> dict[str, Any]:
    return {"imageMode": {"imageTopic": topic}, "layers": {}, "topics": {}}


def _stack(parts: Sequence[Any], direction: str) -> Any:
    """Return panels beside or below one another, of equal size."""
    first, *others = parts
    if not others:
        return first
    return {"direction": direction, "first": first, "second": _stack(others, direction),
            "splitPercentage": 100 / len(parts)}  # fmt: skip
