"""Verbs where no extra is installed, or some alone: they import nothing else outside a refusal."""

import ast
import re
import subprocess
import sys
from functools import cache
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement
from test_live import SENSOR, touch_bundle

import taxel
from taxel.cli.extras import EXTRAS, LIVE_PACKAGES, missing_extra
from taxel.cli.live.bus import check_bus
from taxel.errors import MissingExtra
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CODING, DEPTH_PNG, ROLE, SCENE, CameraInfo, Samples

RUNNER = """
import sys

hidden = set(sys.argv[1].split())


class Installed:
    \"\"\"Finds nothing of what would not be installed.\"\"\"

    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, path=None, target=None):
        if name in hidden:
            return None
        return self.finder.find_spec(name, path, target)

    def __getattr__(self, name):
        return getattr(self.finder, name)


sys.meta_path[:] = map(Installed, sys.meta_path)
from taxel.cli.main import main

main(sys.argv[2:])
"""


def closure(extras: set[str]) -> set[str]:
    """What pip would install for taxel with these extras: names of distributions."""
    found: set[str] = set()
    todo = [("taxel", frozenset(extras))]
    seen = set()
    while todo:
        name, wanted = todo.pop()
        if (name, wanted) in seen:
            continue
        seen.add((name, wanted))
        found.add(name)
        for line in distribution(name).requires or ():
            need = Requirement(line)
            marker = need.marker
            if marker is None or any(marker.evaluate({"extra": extra}) for extra in wanted | {""}):
                todo.append((re.sub(r"[-_.]+", "-", need.name).lower(), frozenset(need.extras)))
    return found


@cache
def distributions() -> dict[str, set[str]]:
    """Each module that can be imported here, and the names of what brought it."""
    return {
        module: {re.sub(r"[-_.]+", "-", name).lower() for name in names}
        for module, names in packages_distributions().items()
    }


def run(extras: set[str], words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command line where these extras alone are installed."""
    brought = closure(extras)
    hidden = [module for module, names in distributions().items() if not brought & names]
    command = [sys.executable, "-c", RUNNER, " ".join(hidden), *words]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )


def printed(extras: set[str], words: list[str], folder: Path) -> str:
    """Run a command line that must succeed; give what it printed."""
    done = run(extras, words, folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


def refusal(extras: set[str], words: list[str], folder: Path) -> str:
    """Run a command line that must end in one line; give it."""
    done = run(extras, words, folder)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    return done.stderr


def touch_recording(path: Path) -> None:
    """Write 40 scans of a touched ball."""
    values = np.random.default_rng(0).random((40, 3)).astype(np.float32)
    manifest = Manifest.started_now(SENSOR, {"shape": "ball"}, now_s=0.0)
    with Recorder(path, manifest) as recorder:
        recorder.write(Samples.from_values(values, np.arange(40) / 100.0))


def test_without_extras_a_recording_is_recorded_told_of_and_answered(tmp_path: Path) -> None:
    """README: `pip install .` alone records, replays and runs live."""
    bundle = touch_bundle(tmp_path / "b.taxel")
    touch_recording(tmp_path / "touch.mcap")
    replay = ["record", "replay://touch.mcap?speed=max", "--output", "again.mcap"]
    assert '"scans": 40' in printed(set(), [*replay, "--seconds", "9", "--json"], tmp_path)
    assert '"windows": 1' in printed(set(), ["live", bundle, "again.mcap", "--json"], tmp_path)
    assert "ball" in printed(set(), ["info", "again.mcap"], tmp_path)


def test_without_extras_intervals_of_an_array_are_labelled(tmp_path: Path) -> None:
    touch_recording(tmp_path / "touch.mcap")
    (tmp_path / "when.csv").write_text("file,start_s,end_s,label:shape\ntouch.mcap,0.1,0.2,ball\n")
    words = ["label", "touch.mcap", "--intervals", "when.csv", "--output", "marked", "--json"]
    assert '"marks": 1' in printed(set(), words, tmp_path)


@pytest.mark.parametrize("scheme", ["serial", "sim", "realsense"])
def test_a_source_whose_extra_is_not_installed_names_it(tmp_path: Path, scheme: str) -> None:
    words = ["record", f"{scheme}://teng", "--output", "a.mcap", "--seconds", "1"]
    assert f"taxel[{scheme}]" in refusal(set(), words, tmp_path)


def test_a_real_hand_needs_no_simulator(tmp_path: Path) -> None:
    """docs/how-to/collect.md: motors and pads on serial ports need the extra `serial`."""
    words = ["hand", "status", "hand://no-such-port"]
    assert "taxel[serial]" in refusal(set(), words, tmp_path)
    assert "needed a hand with motors on no-such-port" in refusal({"serial"}, words, tmp_path)


def test_a_page_that_could_not_show_depth_is_refused(tmp_path: Path) -> None:
    """Where OpenCV is missing the camera's place would stay empty without a word."""
    details = {ROLE: SCENE, CODING: DEPTH_PNG}
    camera = CameraInfo(name="scene-depth", width=8, height=8, rate_hz=30.0, details=details)
    manifest = Manifest.started_now(SENSOR, now_s=0.0, cameras=(camera,))
    with Recorder(tmp_path / "scene.mcap", manifest):
        pass
    assert "taxel[camera]" in refusal({"page"}, ["view", "scene.mcap", "--page"], tmp_path)


def test_the_demos_extras_record_its_simulated_hand(tmp_path: Path) -> None:
    words = ["record", "sim://teng?speed=max", "--output", "hand.mcap", "--seconds", "2", "--json"]
    assert '"scans": 2001' in printed({"train", "page"}, words, tmp_path)


def imported_roots(folder: Path) -> set[str]:
    """Roots of all that the modules of a folder import and Python does not bring."""
    found = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                found |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                found.add(str(node.module).partition(".")[0])
    return found - sys.stdlib_module_names - {"taxel", "_typeshed"}


def test_every_module_that_is_imported_comes_unasked_or_by_a_named_extra() -> None:
    """Tests' own readers of recordings, which a bench shows, are nobody's extra."""
    unasked = set(LIVE_PACKAGES)
    named = {module for extra in EXTRAS.values() for module in extra.modules}
    roots = imported_roots(Path(taxel.__file__).parent)
    assert roots - unasked == (named | {"mcap_ros2", "rosbags"}) - unasked
    assert not named & unasked


def test_the_named_extra_brings_the_module() -> None:
    for extra, (modules, _) in EXTRAS.items():
        for module in modules:
            for name in distributions().get(module, ()):
                assert name in closure({extra}), module


@pytest.mark.parametrize("words", [["train", "touch.mcap"], ["bundle", "run", "--output", "b"]])
def test_a_verb_that_lacks_its_extra_ends_in_one_line(tmp_path: Path, words: list[str]) -> None:
    """It names `train`, which is needed as a whole, and not the part that is missing first."""
    touch_recording(tmp_path / "touch.mcap")
    (tmp_path / "run").mkdir()
    assert "pip install 'taxel[train]'" in refusal(set(), words, tmp_path)


def test_a_viewer_that_is_not_installed_is_refused_before_anything_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("taxel.cli.extras.find_spec", lambda _: None)
    with pytest.raises(MissingExtra, match=r"taxel\[rerun\]"):
        check_bus(["rerun"])


def test_an_extra_of_somebody_elses_is_named_as_it_is() -> None:
    other = MissingExtra("pads", "our-lab", "pads")
    assert missing_extra(other, "taxel train", trains=True) is other


def test_the_demo_says_what_it_lacks_before_it_begins(tmp_path: Path) -> None:
    for extras, brings in (({"sim"}, "train"), ({"train"}, "page")):
        done = run(extras, ["demo"], tmp_path)
        assert f"pip install 'taxel[{brings}]'" in done.stderr
        assert not (tmp_path / "demo").exists()


def test_what_the_lightest_install_says_of_itself_and_of_a_bundle(tmp_path: Path) -> None:
    bundle = touch_bundle(tmp_path / "b.taxel")
    assert "predicts" in printed(set(), ["info", bundle], tmp_path)
    done = run(set(), ["doctor"], tmp_path)  # its end says whether this machine can do live work
    assert "extra train, for training: without torch" in " ".join(done.stdout.split())
