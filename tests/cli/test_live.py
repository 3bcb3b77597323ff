"""`taxel live`: what it is given is what it runs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro

from taxel.bundles.contract import Contract, fingerprint_of
from taxel.bundles.trials import IN_RUN
from taxel.bundles.writer import write_bundle
from taxel.cli.live import live
from taxel.cli.main import main
from taxel.errors import BadBundle
from taxel.models.cnn2d import Cnn2d
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import read_manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo
from taxel.training.loop import new_network
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset
from taxel.windows.scaling import fit_scaling

SENSOR = SensorInfo(name="pad", channels=("a", "b", "c"), units=("V",) * 3, rate_hz=100.0)
STEPS = 40


def test_a_runs_folder_is_refused_with_the_verb_that_bundles_it(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(BadBundle, match=f"a run; write one with: taxel bundle {tmp_path}"):
        tyro.cli(live.Live, args=[str(tmp_path), "sim://teng"]).run()


@pytest.mark.parametrize(
    "words", [["--data", "other"], ["--follow", "30"], ["--hold-level"]], ids=" ".join
)
def test_an_option_of_arrays_is_refused_where_a_run_of_camera_trials_is_bundled(
    words: list[str], tmp_path: Path, refused: Any
) -> None:
    """--data was taken, and no parity measured on it."""
    (tmp_path / IN_RUN).write_bytes(b"")
    line = refused(["bundle", str(tmp_path), "--output", str(tmp_path / "b.taxel"), *words])
    assert f"a run of an array beside {words[0]}" in line


def test_a_second_bundle_beside_one_of_cameras_is_not_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ran: list[Any] = []
    monkeypatch.setattr("taxel.cli.live.station.live_station", ran.append)
    words = ["cup-pour", "sim://cup-pour", "--also", "cup-pour"]
    tyro.cli(live.Live, args=words).run()
    assert len(ran[0].bundles) == 2


TOUCH_WINDOW = WindowConfig(steps=STEPS, stride=STEPS, grid_hz=None, pad=True)


def touch_bundle(path: Path, learned: tuple[str, ...] = ()) -> str:
    """Write a bundle that pads to 0.4 s."""
    values = np.random.default_rng(0).random((8, STEPS, 3)).astype(np.float32)
    mask = np.ones((8, STEPS), bool)
    contract = Contract(
        target="shape", classes=("ball", "block"),
        window=TOUCH_WINDOW,
        scaling=fit_scaling("standard", values, mask, None), channels=SENSOR.channels,
        units=SENSOR.units, rate_hz=100.0, model="cnn2d", parameters=1, data_digest="0" * 64,
        accuracy={}, software="taxel test", parity=None, learned=learned,
    )  # fmt: skip
    network = new_network(lambda: Cnn2d(STEPS, 3, 2), 0)
    write_bundle(path, (network,), contract, values, mask)
    return str(path)


@pytest.fixture
def short_touch(tmp_path: Path) -> tuple[str, str]:
    """A bundle that pads to 0.4 s, and a labelled recording of 0.3 s."""
    values = np.random.default_rng(0).random((8, STEPS, 3)).astype(np.float32)
    bundle = touch_bundle(tmp_path / "b.taxel")
    manifest = Manifest.started_now(SENSOR, {"shape": "ball"}, now_s=0.0)
    with Recorder(tmp_path / "touch.mcap", manifest) as recorder:
        recorder.write(Samples.from_values(values[0, :30], np.arange(30) / 100.0))
    return bundle, str(tmp_path / "touch.mcap")


def test_a_padded_touch_is_counted_right_or_wrong_by_the_sources_labels(
    short_touch: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    main(["live", *short_touch, "--json"])
    (found,) = json.loads(capsys.readouterr().out)

    assert (found["windows"], found["marked"], found["grasps"]) == (1, 1, 1)


def test_what_is_recorded_live_keeps_its_session_and_the_answers_are_summed_up(
    short_touch: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing watches a grasp here: neither its state nor its alarms are spoken of."""
    output = tmp_path / "out.mcap"
    words = ["--record", str(output), "--label", "shape=ball", "--group", "session=7"]
    main(["live", *short_touch, *words, "--least-confidence", "0"])
    printed = capsys.readouterr().out

    assert read_manifest(output).groups == {"session": "7"}
    assert "shape: 1 window: b" in printed
    assert "NONE" not in printed
    assert "alarms" not in printed


def test_what_is_missing_or_of_another_kind_is_named(
    short_touch: tuple[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A path that is not there, a bundle that is not there or empty: each line says so."""
    bundle, touch = short_touch
    monkeypatch.chdir(tmp_path)
    Path("empty.taxel").write_bytes(b"")
    for words, expected in (
        (["live", bundle, "nope"], "'nope', and there is no such file or folder"),
        (["evaluate", "missing.taxel", touch], "got missing.taxel, which is not there"),
        (["info", "empty.taxel"], "a whole taxel bundle in empty.taxel; got an empty file"),
        (["live", "empty.taxel", touch], "a whole taxel bundle in empty.taxel; got an empty file"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 2
        assert expected in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("recorded", [False, True], ids=["one process", "station"])
def test_two_bundles_with_one_target_are_counted_and_named_apart(
    short_touch: tuple[str, str],
    recorded: bool,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    bundle, touch = short_touch
    second = tmp_path / "second.taxel"
    second.write_bytes(Path(bundle).read_bytes())
    words = ["live", bundle, "--also", str(second), touch]
    words += ["--record", str(tmp_path / "out.mcap"), "--overwrite"] if recorded else []
    main([*words, "--json"])
    found = json.loads(capsys.readouterr().out)
    main(words)
    lines = [line for line in capsys.readouterr().out.splitlines() if " window: " in line]

    found = [
        (answer["bundle"], answer["windows"])
        for answer in (found["answers"] if recorded else found)
    ]
    assert found == [(bundle, 1), (str(second), 1)]
    assert [line.split(" (")[1].split(")")[0].split(", ")[0] for line in lines] == [
        bundle,
        str(second),
    ]


@pytest.mark.slow
def test_an_accuracy_on_training_recordings_is_no_test_and_says_so(
    tmp_path: Path, short_touch: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """`taxel live` warns where `taxel evaluate` does; not where nothing is known or labelled."""
    _, touch = short_touch
    fingerprints = load_dataset(Path(touch), TOUCH_WINDOW).fingerprints.values()
    for learned, warning in (
        (tuple(map(fingerprint_of, fingerprints)), "was trained on "),
        ((), "does not say which recordings"),
        (("0" * 16,), None),
    ):
        bundle = touch_bundle(tmp_path / "own.taxel", learned)
        main(["live", bundle, touch, "--json"])
        (found,) = json.loads(capsys.readouterr().out)
        assert (warning in found["warning"]) if warning else found["warning"] is None
        main(["live", bundle, touch])
        printed = " ".join(capsys.readouterr().out.split())
        assert (
            (f"warning: the bundle {warning}" in printed) if warning else "warning" not in printed
        )
