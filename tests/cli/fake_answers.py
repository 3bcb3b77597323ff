"""What the packages below `taxel.cli` answer in the fake world, and what of them stays real."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

REAL = {
    "find_recipe", "parse_reference", "checked_config", "find_bundle", "shipped_bundle",
    "rule_named", "plan_rows", "list_runs", "section_plan", "titles", "without_controls",
    "visible_line", "visible", "shell_words", "json_text", "parse_options", "recordings_of",
}  # fmt: skip
"""Functions that only compute and that verbs need to go on; they stay as they are."""
FAKED = {
    "BackboneExtractor",
    "Station",
    "Bundle",
    "Provenance",
    "Manifest",
    "Correction",
    "StationPage",
    "Samples",
}
"""Data classes that do work; not their data but what is asked of them counts."""
CALLED = {"open_way", "show", "on_tick"}
"""Functions that a verb hands on to be called, and that use its options."""
FAKED_VERB_PARTS = {
    "taxel.cli.evaluation.evaluate_trials.AlarmStudy",
    "taxel.cli.evaluation.evaluate_trials._scores",
    "taxel.cli.training.train_recipe.warning",
    "taxel.cli.training.train_monitor._check",
    "taxel.cli.recordings.view.show",
    "taxel.cli.recordings.label._print",
    "taxel.cli.recordings.label._plain",
    "taxel.cli.recordings.info._print_bundle",
    "taxel.cli.recordings.info._print_recording",
    "taxel.cli.recordings.info._print_folder",
    "taxel.cli.devices.flash.hear_hello",
    "taxel.cli.devices.flash.check_port",
    "taxel.cli.devices.flash._run",
    "taxel.cli.devices.flash_tools.commands",
    "taxel.cli.devices.flash.commands",
    "taxel.cli.training.train_monitor._contract",
    "taxel.cli.devices.flash._dotted",
    "taxel.cli.recordings.import_._of_videos",
    "taxel.cli.bench.import_module",
    "taxel.cli.devices.doctor.write_speed",
    "taxel.cli.devices.calibrate_cycles.measure_cycles",
    "taxel.cli.devices.calibrate_cycles.write_cycles",
    "taxel.cli.devices.power.estimate_power",
    "taxel.cli.devices.power._print",
    "taxel.cli.recordings.record.ledger_line",
    "taxel.cli.recordings.record_plan.record_plan",
    "taxel.cli.recordings.hand.use_hand",
    "taxel.cli.recordings.hand._line",
    "taxel.cli.recordings.collect.collect_plan",
    "taxel.cli.live.station._free_port",
    "taxel.cli.live.station.token_urlsafe",
    "taxel.cli.devices.find.find_boards",
    "taxel.cli.devices.find.find_cameras",
    "taxel.cli.devices.find.find_scene_cameras",
}
"""Parts of verbs that compute with what stand-ins cannot give, or that touch devices."""


class _Any(str):
    """Equals whatever a board was told to be."""

    __hash__ = str.__hash__

    def __eq__(self, _: object) -> bool:
        return True

    def __ne__(self, _: object) -> bool:
        return False

    def __str__(self) -> str:
        return self


def _touched(path: Path) -> Any:
    """Make the file that a function below would have written; nothing else is answered."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return ...


_SUMMARY = {
    "windows": 3, "filled": 1, "answers": {"cup": 3}, "marked": 2, "right": 1, "grasps": 1,
    "grasps_right": 1, "grasps_without": 0, "latency_us_median": 1.0,
    "latency_us_p99": 1.0, "target": "object", "gate_moves": [], "still_channels": [],
    "actions": {}, "outages": [], "level": None, "rate_changes": [], "other_scales": [],
    "untouched": "",
}  # fmt: skip
ATTRIBUTES: dict[str, Any] = {
    "measured": {},
    "disarms": False,
    "shown": ("STABLE",),
    "latencies": SimpleNamespace(percentiles_ms=dict),
    "decision": SimpleNamespace(state=SimpleNamespace(name="STABLE"), reason="", slip=None),
    "feeds": [SimpleNamespace(url="sim://cup-pour", worker=SimpleNamespace(name="w"))],
}
"""Attribute → its value, where a verb's way goes by it."""
ANSWERS: dict[str, Any] = {
    "is_grasp_bundle": lambda path: "cup" in str(path),
    "kind_of": lambda path: "array" if str(path).endswith(".taxel") else None,
    "is_trial_bundle": lambda path: "trial" in str(path).rpartition("/")[2],
    "are_camera_trials": lambda path: "trial" in str(path).rpartition("/")[2],
    "read_camera_trials": lambda _: [],
    "named_path": lambda path: path,
    "check_page": lambda _: False,
    "list_recordings": lambda path: (
        [Path("a.mcap"), Path("b.mcap")] if str(path) == "folder" else [Path(path)]
    ),
    "write_pours": lambda _, config, *__: [
        {"force_n": force, "outcome": "hold", "slip_um": 1.0, "run": "r"}
        for force in config.forces_n
    ],
    "write_bundle": lambda path, *_: _touched(path),
    "train_bundle": lambda _, __, path, *___: _touched(path),
    "Recorder": lambda path, *_: _touched(path),
    "mark_recordings": lambda *_: SimpleNamespace(
        recordings=[Path("a.mcap")], marks=[], replaced=0, left_out=[]
    ),
    "run_session": lambda _, recognisers, *__: [
        SimpleNamespace(
            summary=lambda: dict(_SUMMARY),
            still_channels=[],
            outages=[],
            rate_changes=[],
            other_scales=[],
        )
        for _ in recognisers
    ],
    "run_grasp_session": lambda *_: SimpleNamespace(
        summary=lambda: {"states": {}, "moments": 0, "alarms": 0, "grasps": []}
    ),
    "hear_hello": lambda *_: SimpleNamespace(
        protocol=_Any(), firmware=_Any(), board=_Any(), board_id=_Any()
    ),
    "import_module": lambda _: SimpleNamespace(
        quick_steps=lambda: [("given", None), ("other", None)],
        full_steps=lambda data: [(f"given {data}", None)],
        data_digest=str,
    ),
    "_of_videos": lambda path: "videos" in str(path),
    "record_presses": lambda _, path, *__: _touched(path),
    "plan_array": lambda *_: {"noise": (1.0,)},
    "find_boards": lambda: ([], []),
    "find_cameras": list,
    "find_scene_cameras": lambda: ([], []),
}
"""Function → what it answers, where a verb's way goes by it."""
TEXTS = {"digest", "url", "words", "plain"}
"""Attributes that verbs join to text."""
