"""A channel that is dead now, or an array that hangs: what `live` and `evaluate` say of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.reader import read_bundle
from taxel.cli.main import main


def _set(
    folder: Path,
    *,
    dead: bool = False,
    hangs: bool = False,
    gain: float = 1.0,
    rows: int = 1000,
    count: int = 8,
) -> Path:
    """Presses of two strengths, two a session, 50 scans a second, 20 s each."""
    folder.mkdir()
    rng = np.random.default_rng(int(dead))
    lines = ["file,label:level,group:session,channels,time"]
    for n in range(count):
        press = np.sin(np.linspace(0, 100 * np.pi, 1000))[:, None] * (2.0, 10.0)[n % 2]
        values = gain * (press + rng.normal(0.0, 0.5, (1000, 3)))
        if dead:
            values[:, 1] = 0.25
        if hangs:
            values[500:] = values[500]
        np.savetxt(folder / f"t{n}.csv", values[:rows], delimiter=",")
        lines.append(f"t{n}.csv,{('2', '10')[n % 2]},s{n // 2},1[N] 2[N] 3[N],rate:50Hz")
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    main(["import", str(folder / "table.csv"), "--output", str(folder / "set")])
    return folder / "set"


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dead")
    alive = _set(folder / "alive")
    run, bundle = folder / "run", folder / "press.taxel"
    main(["train", str(alive), "--model", "cnn1d", "--epochs", "1", "--window", "steps=20",
          "gate=none", "--no-check", "--output", str(run)])  # fmt: skip
    main(["bundle", str(run), "--output", str(bundle)])
    _set(folder / "dead", dead=True)
    _set(folder / "hangs", hangs=True)
    return bundle


def test_live_names_it_once_on_the_error_stream_and_in_json(
    bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = f"replay://{bundle.parent / 'dead' / 'set'}?speed=max"
    capsys.readouterr()

    main(["live", str(bundle), source, "--json"])
    captured = capsys.readouterr()

    (still,) = json.loads(captured.out)[0]["still_channels"]
    assert (still["channel"], still["changed"]) == ("2", 1.0)
    assert captured.err.count("channel 2 has not changed for ") == 1
    assert "in training it changed in every window: check its cable" in captured.err


def test_lines_of_a_folder_name_the_recording_and_its_own_time(
    bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They gave the host's clock, such as 37972.9 s, of recordings of 20 s."""
    hangs = bundle.parent / "hangs" / "set"
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{hangs}?speed=max"])
    folder = capsys.readouterr().out
    main(["live", str(bundle), f"replay://{hangs / 't3.mcap'}?speed=max"])
    alone = capsys.readouterr().out

    for number in range(8):
        assert f"warning: t{number}, 10.0 s to the end: no usable values" in folder
    assert "warning: 10.0 s to the end: no usable values" in alone


def test_live_names_it_over_recordings_of_a_single_window_each(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short = _set(tmp_path / "short", dead=True, rows=20, count=24)
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{short}?speed=max", "--json"])
    captured = capsys.readouterr()

    (result,) = json.loads(captured.out)
    assert result["windows"] == 24
    assert [still["channel"] for still in result["still_channels"]] == ["2"]
    assert captured.err.count("channel 2 has not changed for ") == 1


def test_nothing_is_said_where_all_channels_move(
    bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    alive = bundle.parent / "alive" / "set"
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{alive}?speed=max", "--json"])
    main(["evaluate", str(bundle), str(alive)])
    captured = capsys.readouterr()

    assert "changed" not in captured.err
    assert "never changes" not in captured.out


def test_a_score_says_it(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()

    main(["evaluate", str(bundle), str(bundle.parent / "dead" / "set")])
    printed = " ".join(capsys.readouterr().out.split())

    assert "channel 2 never changes in these recordings; in training it changed in every" in printed


def test_a_score_says_it_of_a_session_with_lower_gains(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All its presses are weaker than three quarters of those in training."""
    quiet = _set(tmp_path / "quiet", dead=True, gain=0.15)
    capsys.readouterr()

    main(["evaluate", str(bundle), str(quiet)])

    assert "channel 2 never changes in these recordings" in capsys.readouterr().out


@pytest.mark.parametrize(("gain", "noted"), [(1000.0, True), (0.001, True), (3.0, False)])
def test_a_score_says_where_values_are_in_another_unit(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], gain: float, noted: bool
) -> None:
    other = _set(tmp_path / "other", gain=gain)
    capsys.readouterr()

    main(["evaluate", str(bundle), str(other)])
    printed = " ".join(capsys.readouterr().out.split())

    assert ("times as much within a window as in training: check whether they are in N" in printed
            ) == noted  # fmt: skip


@pytest.mark.parametrize("gain", [1000.0, 3.0])
def test_live_says_once_where_values_are_in_another_unit(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], gain: float
) -> None:
    """Eight recordings, each a stream of its own: still once."""
    other = _set(tmp_path / "other", gain=gain)
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{other}?speed=max", "--json"])
    captured = capsys.readouterr()
    main(["live", str(bundle), f"replay://{other}?speed=max"])
    printed = " ".join(capsys.readouterr().out.split())

    count = int(gain > 20)
    (result,) = json.loads(captured.out)
    words = "times as much within a window as in training: check whether they are in N"
    assert [scale["share"] > 100 for scale in result["other_scales"]] == [True] * count
    assert result["untouched"] == ""
    assert captured.err.count(words) == count
    assert printed.count(words) == count


def test_live_says_at_the_end_where_nothing_changed_as_touch_does(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = _set(tmp_path / "other", gain=0.001)
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{other}?speed=max"])
    captured = capsys.readouterr()

    assert "nothing was touched, or values are not in N" in " ".join(captured.out.split())
    assert captured.err == ""


def test_live_names_a_dead_channel_of_a_session_with_lower_gains(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    quiet = _set(tmp_path / "quiet", dead=True, gain=0.15)
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{quiet}?speed=max", "--json"])
    captured = capsys.readouterr()

    assert captured.err.count("channel 2 has not changed for ") == 1


def test_a_bundle_keeps_how_its_channels_moved(bundle: Path) -> None:
    motion = read_bundle(bundle).contract.motion

    assert motion is not None
    assert motion.still.tolist() == [0.0, 0.0, 0.0]


def test_an_array_that_repeats_one_scan_is_unknown_live_and_in_a_score(
    bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each recording has 50 windows of 20 rows, of which the last 25 hold one scan."""
    hangs = bundle.parent / "hangs" / "set"
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{hangs}?speed=max", "--json"])
    (result,) = json.loads(capsys.readouterr().out)
    main(["evaluate", str(bundle), str(hangs), "--json"])
    scored = json.loads(capsys.readouterr().out)

    outage = result["outages"][0]
    assert outage["reason"] == (
        "all channels repeat one scan: the array has stopped, or rests without noise"
    )
    assert outage["end_s"] is None
    assert scored["unknown"] >= 0.5
    assert scored["unknown_because"].get(outage["reason"]) == 8 * 25
