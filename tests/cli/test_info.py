"""`taxel info`: a folder fits a terminal of 80 columns; a bundle says what it predicts."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tyro

from taxel.bundles import contract as arrays
from taxel.bundles import trials
from taxel.bundles.envelope import pack
from taxel.cli.main import main
from taxel.cli.recordings.info import Info, _span
from taxel.cli.recordings.simulate.teng import Teng
from taxel.errors import BadRecording
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.windows.config import TENG_WINDOW
from taxel.windows.scaling import fit_scaling
from taxel.windows.trial_crops import FAMILIES

VIEW = next(iter(FAMILIES))
ARRAY = arrays.Contract(
    target="shape", classes=tuple(f"c{i}" for i in range(10)), window=TENG_WINDOW,
    scaling=fit_scaling("full-scale", np.ones((2, 12, 12), "f4"), np.ones((2, 12), bool), 3.3),
    channels=tuple(f"s{i}" for i in range(12)), units=("V",) * 12, rate_hz=1000.0, model="cnn2d",
    parameters=5987, data_digest="0" * 64, accuracy={"session held out": 0.77},
    software="taxel test", parity=None,
)  # fmt: skip
TRIALS = trials.TrialContract(
    target="slip", classes=("held", "slipped"), crop=12, places=3, views=(VIEW,),
    versions=(FAMILIES[VIEW].key,), cameras=1, width=320, height=240, rate_hz=25.0,
    mm_per_px=0.065, sharpness=1.0, threshold=None, data_digest="0" * 64, measured={},
    software="taxel test",
)  # fmt: skip


def test_a_folder_fits_80_columns_and_says_what_its_groups_hold(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "80")
    words = ["--output", str(tmp_path / "data"), "--scans-per-class", "2000"]
    tyro.cli(Teng, args=[*words, "--sessions", "2", "--json"]).run()
    capsys.readouterr()
    Info(tmp_path / "data").run()

    lines = capsys.readouterr().out.splitlines()
    table = lines[: next(i for i, line in enumerate(lines) if "checksums valid" in line)]
    assert any("session-1.mcap" in line for line in table)
    assert max(map(len, table)) <= 80
    assert not any("…" in line for line in table)
    assert "group session: session-1, session-2" in lines


def many(tmp_path: Path, recordings: int, channels: int) -> Path:
    info = SensorInfo(name="pad", channels=tuple(f"c{i}" for i in range(channels)),
                      units=("N",) * channels, rate_hz=100.0)  # fmt: skip
    for i in range(recordings):
        manifest = Manifest(sensor=info, labels={"object": "cup"})
        with Recorder(tmp_path / "many" / f"t-{i:03d}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(np.ones((3, channels)), np.arange(3) / 100.0))
    return tmp_path / "many"


def test_a_folder_of_many_lists_some_and_counts_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder = many(tmp_path, 45, 2)
    main(["info", str(folder)])
    lines = capsys.readouterr().out.splitlines()
    assert sum("t-0" in line for line in lines) == 40
    assert "and 5 more recordings (--all)" in lines
    assert f"{folder}: 45 recordings, 135 scans, 0.9 s, all checksums valid" in " ".join(lines)
    assert "label object: cup=45 (recordings)" in lines

    main(["info", str(folder), "--all"])
    everything = capsys.readouterr().out
    assert sum("t-0" in line for line in everything.splitlines()) == 45
    assert "more recording" not in everything
    main(["info", str(folder), "--json"])
    assert len(json.loads(capsys.readouterr().out)) == 45


def test_a_recording_of_many_channels_lists_some(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    file = many(tmp_path, 1, 103) / "t-000.mcap"
    main(["info", str(file)])
    shown = capsys.readouterr().out
    assert "c99" in shown
    assert "c100" not in shown
    assert "and 3 more channels (--all)" in shown
    main(["info", str(file), "--all"])
    assert "c102" in capsys.readouterr().out


def test_a_group_is_one_value_a_range_or_names():
    assert _span([f"r{n}" for n in range(41)] * 2).endswith(" and 35 more")
    assert _span(["a", "a"]) == "a"
    assert _span(["9.5", "10", "-1"]) == "-1 to 10"
    assert _span(["20", "100", "20"]) == "20, 100"
    assert _span(["a#10", "a#2", "a#1"] * 2) == "a#1, a#2, a#10"
    cut_from = [f"a#{n}" for n in range(1, 31)] * 9
    assert _span(cut_from, shared=False) == "a#1, a#2, a#3, a#4, a#5, a#6 and 24 more"
    assert _span([f"s{i}" for i in range(8)]) == "s0, s1, s2, s3, s4, s5 and 2 more"


def test_recordings_of_one_scan_have_no_length_and_no_measured_rate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    sensor = SensorInfo(name="pad", channels=("a",), units=("N",), rate_hz=1.0)
    for name in ("a", "b"):
        with Recorder(tmp_path / f"{name}.mcap", Manifest.started_now(sensor)) as recorder:
            recorder.write(Samples.from_values(np.ones((1, 1)), np.zeros(1)))

    main(["info", str(tmp_path)])
    main(["info", str(tmp_path / "a.mcap")])

    text = capsys.readouterr().out
    assert f"{tmp_path}: 2 recordings, 2 scans, all checksums valid\n" in text
    assert "scans      1\n" in text
    assert "rate       not measured, 1 scans/s nominal\n" in text


def test_pieces_name_few_of_the_files_that_they_were_cut_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    sensor = SensorInfo(name="pad", channels=("a",), units=("N",), rate_hz=10.0)
    marks = [
        Mark(start_s=n / 10, end_s=n / 10, labels={}, groups={"cut_from": f"a.csv#{n // 2 + 1}"})
        for n in range(20)
    ]
    with Recorder(tmp_path / "a.mcap", Manifest.started_now(sensor)) as recorder:
        recorder.write(Samples.from_values(np.ones((20, 1)), np.arange(20) / 10))
        for mark in marks:
            recorder.mark(mark)

    main(["info", str(tmp_path)])

    shown = ", ".join(f"a.csv#{n}" for n in range(1, 7))
    assert f"group cut_from: {shown} and 4 more\n" in capsys.readouterr().out


def test_a_bundle_says_what_it_predicts_from_what_and_how_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    for name, member in (
        ("bundle.json", arrays.contract_to_json(ARRAY)),
        ("trials.json", trials.contract_to_json(TRIALS)),
    ):
        (tmp_path / f"{name}.taxel").write_bytes(pack({name: member.encode()}))

    Info(tmp_path / "bundle.json.taxel").run()
    printed = " ".join(capsys.readouterr().out.split())
    assert "predicts shape: c0, c1, c2, c3, c4, c5, c6, c7 and 2 more" in printed
    assert "12 channels in V, windows of 12 scans" in printed
    assert "accuracy, session held out 0.77" in printed
    assert "not signed" in printed
    assert "random guessing among 10 classes gives 0.10" in printed
    assert "recordings with SHA-256 000000000000…" in printed

    Info(tmp_path / "trials.json.taxel").run()
    printed = " ".join(capsys.readouterr().out.split())
    assert "predicts slip: held, slipped" in printed
    assert "camera trials of 1 camera, 320×240, 25 frames/s; 3 crops of 12 frames" in printed
    assert "nothing was stored with it" in printed


def test_info_says_on_what_a_monitor_was_measured(capsys: pytest.CaptureFixture[str]):
    """The threshold was set on those cups, so that figures on test cups are worse."""
    main(["info", "cup-pour"])
    printed = " ".join(capsys.readouterr().out.split())
    assert "measured on training cups held out, not test cups: false alarms a minute" in printed


def test_info_says_when_a_bundle_answers_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """A bundle without a test of novelty still answers UNKNOWN, and info says what for."""
    for name, member in (
        ("bundle.json", arrays.contract_to_json(ARRAY)),
        ("trials.json", trials.contract_to_json(TRIALS)),
        ("trials.json", trials.contract_to_json(replace(TRIALS, threshold=4.25))),
    ):
        path = tmp_path / "own.taxel"
        path.write_bytes(pack({name: member.encode()}))
        main(["info", str(path)])
    printed = " ".join(capsys.readouterr().out.split())
    assert "says UNKNOWN never" not in printed
    assert printed.count("says UNKNOWN confidence below 0.5 (--least-confidence)") == 3
    assert "a channel at the converter's limit; novel touch is not tested" in printed
    assert "fewer than 12 frames" in printed
    assert "a novelty score above 4.25" in printed


def test_a_signature_is_not_taken_for_a_valid_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    line, _, rest = pack({"bundle.json": arrays.contract_to_json(ARRAY).encode()}).partition(b"\n")
    (tmp_path / "a.taxel").write_bytes(line + b" " + b"0" * 176 + b"\n" + rest)
    Info(tmp_path / "a.taxel").run()
    printed = " ".join(capsys.readouterr().out.split())
    assert "with a signature, which is not checked here" in printed


def test_a_bundle_that_comes_with_taxel_goes_by_its_name(capsys: pytest.CaptureFixture[str]):
    main(["info", "cup-pour", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["kind"] == "grasp"
    assert found["contract"]["rule"] == "gross-slip"

    main(["info", "cup-pour"])
    assert "warns from a score of" in " ".join(capsys.readouterr().out.split())


def test_a_damaged_bundle_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    whole = pack({"bundle.json": arrays.contract_to_json(ARRAY).encode()})
    (tmp_path / "a.taxel").write_bytes(whole[:-9] + bytes(9))
    with pytest.raises(SystemExit) as ended:
        main(["info", str(tmp_path / "a.taxel")])
    assert ended.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_folder_lists_the_groups_that_marks_give(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Objects that intervals name can be held out, and stand beside the recordings' own."""
    sensor = SensorInfo(name="pad", channels=("a",), units=("N",), rate_hz=100.0)
    for name in ("one", "two"):
        manifest = Manifest.started_now(sensor, {}, {"session": name}, now_s=0.0)
        with Recorder(tmp_path / f"{name}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(np.zeros((50, 1), "f4"), np.arange(50) / 100.0))
            for place, cup in enumerate(("mug", "can")):
                start = place * 0.2
                recorder.mark(Mark(start_s=start, end_s=start + 0.1, labels={"grip": "firm"},
                                   groups={"object": cup}))  # fmt: skip
    Info(tmp_path).run()

    lines = capsys.readouterr().out.splitlines()
    assert "group object: can, mug" in lines
    assert "group session: one, two" in lines


def test_a_folder_counts_the_trials_of_each_label_where_recordings_hold_marks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """A mark is a trial with the recording's label, or its own; without marks there is one."""
    sensor = SensorInfo(name="pad", channels=("a",), units=("N",), rate_hz=100.0)
    mug, can = {"object": "mug"}, {"object": "can"}
    for name, labels, marks in (
        ("a", mug, []), ("b", can, [{}, {}, {"object": "mug"}]), ("c", {}, [{}])
    ):  # fmt: skip
        manifest = Manifest.started_now(sensor, labels, {}, now_s=0.0)
        with Recorder(tmp_path / f"{name}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(np.zeros((50, 1), "f4"), np.arange(50) / 100.0))
            for place, own in enumerate(marks):
                start = place * 0.1
                recorder.mark(Mark(start_s=start, end_s=start + 0.05, labels=own, groups={}))
    Info(tmp_path).run()
    assert "label object: can=2, mug=2, –=1 (trials)" in capsys.readouterr().out.splitlines()

    for name in ("b", "c"):
        (tmp_path / f"{name}.mcap").unlink()
    Info(tmp_path).run()
    assert "label object: mug=1 (recordings)" in capsys.readouterr().out.splitlines()


def test_a_table_of_camera_trials_is_described_in_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Trials, cameras, labels and groups, and the verb that comes next; many values by number."""
    lines = ["camera:gel,label:kind,group:object,group:take"]
    for number in range(26):
        image = np.full((8, 12, 3), 9 * number, np.uint8)
        cv2.imwrite(str(tmp_path / f"i{number}.png"), image)
        lines.append(
            f"i{number}.png,{'soft' if number % 2 else 'hard'},o{number // 2},{number % 2}"
        )
    table = tmp_path / "trials.csv"
    table.write_text("\n".join(lines) + "\n")
    Info(table).run()
    assert capsys.readouterr().out.splitlines() == [
        f"{table}: 26 camera trials of 1 camera (gel), 12×8, 1 frame",
        "label kind: hard (13), soft (13)",
        "group object: 13 values of 2 trials each",
        "group take: 0 (13), 1 (13)",
        f"next: taxel evaluate-trials {table} --target kind",
    ]
    Info(table, json=True).run()
    data = json.loads(capsys.readouterr().out)
    assert data["labels"] == {"kind": {"hard": 13, "soft": 13}}
    assert (data["trials"], data["frames"], data["sizes"]) == (26, [1, 1], ["12×8"])


def test_what_stands_in_the_way_of_training_takes_the_place_of_the_next_verb(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Two sizes, no label; the same image twice is said, and a split is no group."""
    for name, shape in (("a", (8, 12)), ("b", (8, 12)), ("c", (9, 12)), ("d", (8, 12))):
        level = 5 if name in "ab" else 90
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((*shape, 3), level, np.uint8))
    table = tmp_path / "trials.csv"
    head = "camera:gel,label:kind,split"
    for rows, expected in (
        (["a.png,x,train", "c.png,y,test"], "note: a recogniser needs images of one size"),
        (["a.png,x,train", "b.png,y,test"], "note: 2 trials of the same images as another"),
    ):
        table.write_text("\n".join([head, *rows]) + "\n")
        Info(table).run()
        lines = capsys.readouterr().out.splitlines()
        assert lines[2] == "split: test (1), train (1)"
        assert lines[3].startswith(expected)
        assert not any(line.startswith("next") for line in lines)
    table.write_text("camera:gel\na.png\nd.png\n")
    Info(table).run()
    assert "note: no label: add a column label:NAME" in capsys.readouterr().out


def test_a_table_with_other_columns_is_refused_by_the_needed_and_the_found_ones(tmp_path: Path):
    table = tmp_path / "trials.csv"
    table.write_text("links;rechts;label:kind\na.mp4;b.mp4;x\n")
    with pytest.raises(BadRecording) as refused:
        Info(table).run()
    assert str(refused.value) == (
        "needed a recording (MCAP), or a table of camera trials with the columns left, right (or "
        "camera:NAME), label:NAME and group:NAME; got the columns 'links', 'rechts', 'label:kind' "
        f"in {table}, line 1; mend that line, or import tables with: taxel import."
    )


def test_a_table_of_arrays_is_still_sent_to_import(tmp_path: Path):
    table = tmp_path / "table.csv"
    table.write_text("file,label:kind,time\na.csv,x,rate:100Hz\n")
    with pytest.raises(BadRecording, match="import tables with: taxel import"):
        Info(table).run()


def test_recordings_of_a_folder_are_listed_by_their_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """trial-1000, which a long plan records, stood before trial-101."""
    info = SensorInfo(name="pad", channels=("c",), units=("N",), rate_hz=100.0)
    for number in (1000, 101, 99):
        with Recorder(tmp_path / f"trial-{number:03d}.mcap", Manifest(sensor=info)) as recorder:
            recorder.write(Samples.from_values(np.ones((3, 1)), np.arange(3) / 100.0))
    main(["info", str(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if "trial-" in line.split(".")[0]] == [
        "trial-099.mcap", "trial-101.mcap", "trial-1000.mcap",
    ]  # fmt: skip
