"""`taxel adapt` from the command line: a new class, a new pad, corrections, and back again."""

import contextlib
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.reader import read_bundle, read_contract
from taxel.bundles.versions import digest_of
from taxel.cli.main import main
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, SensorInfo
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.adapt.correcting import learn_corrections
from taxel.training.adapt.drift import Drift
from taxel.training.adapt.new_data import clock_time, read_grasps
from taxel.training.run import load_run
from taxel.windows.dataset import load_dataset

SENSOR = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=100.0)
Keep = Callable[[Mark], bool]
KNOWN: Keep = lambda mark: mark.groups["object"] == "cylinder-glass"  # noqa: E731
SPHERE: Keep = lambda mark: mark.labels["shape"] == "sphere"  # noqa: E731


def copy(source: Path, output: Path, keep: Keep, gain: float = 1.0) -> None:
    """Write a recording again with some of its grasps; with a gain it is another recording."""
    recording = read_recording(source)
    samples = replace(recording.samples, values=recording.samples.values * np.float32(gain))
    with Recorder(output, recording.manifest) as recorder:
        recorder.write(samples)
        for mark in filter(keep, recording.marks):
            recorder.mark(mark)


def run(words: str, capsys: pytest.CaptureFixture[str]) -> dict:
    main([*words.split(), "--json"])
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sessions without spheres, a run and its bundle, and recordings of the third."""
    folder = tmp_path_factory.mktemp("adapt")
    simulate_presets(folder, ("honest",), 20_000, 0)
    sessions = sorted((folder / "honest").glob("*.mcap"))
    (folder / "old").mkdir()
    for path in sessions[:4]:
        copy(path, folder / "old" / path.name, lambda mark: not SPHERE(mark))
    copy(sessions[0], folder / "new.mcap", lambda mark: SPHERE(mark) or KNOWN(mark))
    copy(sessions[0], folder / "bare.mcap", SPHERE)
    copy(sessions[5], folder / "touch.mcap", KNOWN)
    copy(sessions[5], folder / "held-out.mcap", lambda mark: True)
    shutil.rmtree(folder / "honest")
    train = f"train {folder}/old --recipe teng-referenced --no-check --output {folder}/run"
    main(
        [
            "train",
            *train.split()[1:],
            "--window",
            "reference=object=cylinder-glass:1",
            "--epochs",
            "4",
        ]
    )
    main(["bundle", f"{folder}/run", "--output", f"{folder}/shape.taxel"])
    return folder


@pytest.fixture
def place(made_once: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(made_once, tmp_path / "work")
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


def test_a_class_is_learned_from_five_grasps_and_taken_back(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = run("adapt run --new new.mcap --test held-out.mcap", capsys)
    history = run("adapt run --history", capsys)
    bundled = run("bundle run --output three.taxel --data old", capsys)
    back = run("adapt run --rollback", capsys)

    assert found["version"] == 2
    assert found["new"] == {"sphere": 5}
    assert found["before"]["sphere"] == 0.0
    assert found["after"]["sphere"] > 0.7
    assert found["after"]["all"] > found["before"]["all"]
    assert [version["number"] for version in history["versions"]] == [1, 2]
    assert history["versions"][1]["change"]["data"] == ["new.mcap"]
    assert bundled["parity"] < 1e-4
    assert read_contract(Path("three.taxel")).classes == ("cylinder", "rectangle", "sphere")
    assert back["number"] == 1
    assert run("adapt run --history", capsys)["current"] == 1
    assert Path("run.v2/run.json").exists()


def test_a_pad_is_brought_to_level_without_touching_the_model(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = Path("shape.taxel").read_bytes()
    found = run("adapt shape.taxel --touches touch.mcap", capsys)

    assert found["version"] == 2
    assert found["touches"] >= 1
    assert max(found["change"]) / min(found["change"]) > 1.0
    assert Path("shape.v1.taxel").read_bytes() == before
    contract = read_bundle(Path("shape.taxel")).contract
    assert contract.reference is not None
    np.testing.assert_allclose(contract.reference.level, found["level"], rtol=1e-6)
    run("adapt shape.taxel --rollback 1", capsys)
    assert Path("shape.taxel").read_bytes() == before


def test_a_run_can_be_brought_to_level_too_and_its_exemplars_with_it(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old = load_run(Path("run"))
    found = run("adapt run --touches touch.mcap --output other", capsys)
    new = load_run(Path("other"))

    assert old.exemplars is not None
    assert new.exemplars is not None
    np.testing.assert_allclose(
        new.contract.scaling.apply(new.exemplars.values, new.exemplars.mask),
        old.contract.scaling.apply(old.exemplars.values, old.exemplars.mask),
        atol=1e-5,
    )
    assert found["output"] == "other"
    assert not Path("run.v1").exists()


def test_corrected_grasps_are_learned_in_their_order(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("adapt run --new new.mcap", capsys)
    found = run("adapt run --correct held-out.mcap --output corrected", capsys)

    assert found["grasps"] > 10
    assert found["unlearned"] > 0.9  # the sessions are alike: the run as it was knows them too
    assert set(found["after"]) == {"all", "cylinder", "rectangle", "sphere"}
    assert found["measured_on"] == "the run's rehearsed grasps"
    assert Path("corrected.versions.json").exists()


def test_tables_are_printed_for_people(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["adapt", "shape.taxel", "--touches", "touch.mcap"])
    main(["adapt", "run", "--new", "new.mcap", "--test", "held-out.mcap"])
    main(["adapt", "run", "--history"])
    out = capsys.readouterr().out

    assert "little-distal" in out
    assert "new class 'sphere' from 5 grasps" in out
    assert "all known before" in out
    assert "run.v1" in out


def test_what_must_be_said_stands_in_lines_of_its_own(
    place: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A test for unknown touch that is left out; drifts."""
    copy(place / "held-out.mcap", place / "known.mcap", lambda mark: not SPHERE(mark))
    trained = load_run(Path("run"))
    sure = replace(trained, contract=replace(trained.contract, unknown=object()))
    monkeypatch.setattr("taxel.cli.live.adapt._load", lambda _: sure)
    main(["adapt", "run", "--new", "new.mcap", "--output", "taught"])
    taught = capsys.readouterr().out
    drifted = learn_corrections(trained, read_grasps([place / "known.mcap"], trained.contract))
    drifts = (Drift(grasp=0, before=0.1, after=0.4), Drift(grasp=1, before=0.4, after=0.7))
    monkeypatch.setattr("taxel.training.adapt.correcting.learn_corrections",
                        lambda *_, **__: replace(drifted, drifts=drifts))  # fmt: skip
    main(["adapt", "run", "--correct", "known.mcap", "--output", "corrected"])
    corrected = capsys.readouterr().out

    assert "\nthe test for unknown touch is left out" in taught
    assert corrected.count("\ndrift since ") == 2
    assert "x0a" not in taught + corrected


@pytest.mark.parametrize(
    ("words", "part"),
    [
        ("run", "--touches"),
        ("run --new new.mcap --history", "choose one"),
        ("shape.taxel --new new.mcap", "a run's folder"),
        ("run --new old --grasps 5", "--correct"),
        ("run --new bare.mcap", "record them at the start"),
        ("run --new nothing.mcap", "not there"),
        ("run --new new.mcap --grasps 0", "--grasps"),
        ("run --correct new.mcap", "--new"),
        ("run --new new.mcap --test new.mcap", "are to be learned; record others"),
        ("run --new new.mcap --test .", "bare.mcap, where"),
        ("run --correct held-out.mcap --test held-out.mcap", "are to be learned"),
        ("run --touches touch.mcap --rollback", "one after the other"),
        ("run --history --test held-out.mcap", "--history and --test"),
        ("cup-pour --touches touch.mcap", "of tactile cameras; leave it as it is"),
        ("cup-pour --history", "of tactile cameras"),
        ("old --touches touch.mcap", "old, a folder"),
        ("run --rollback --output free", "leave it out"),
        ("run --rollback", "former version"),
        ("run --rollback 7", "--history"),
        ("run --touches touch.mcap --output old", "--output"),
        ("nothing.taxel --touches touch.mcap", "taxel bundle"),
        ("nothing.taxel --history", "no nothing.taxel"),
    ],
)
def test_what_cannot_be_meant_is_one_plain_line_and_changes_nothing(
    place: Path, capsys: pytest.CaptureFixture[str], words: str, part: str
) -> None:
    before = sorted(place.rglob("*"))
    with pytest.raises(SystemExit) as ended:
        main(["adapt", *words.split()])

    message = capsys.readouterr().err
    assert ended.value.code == 2
    assert part in message
    assert message.count("\n") == 1
    assert sorted(place.rglob("*")) == before


def test_touches_may_stand_in_for_a_sessions_own(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The recording of spheres alone has no reference touches of its own."""
    copy(place / "new.mcap", place / "own-touch.mcap", KNOWN)

    found = run("adapt run --new bare.mcap --touches own-touch.mcap --test held-out.mcap", capsys)

    assert found["after"]["sphere"] > 0.7


def test_the_level_of_the_touches_is_that_of_their_sessions_test_recordings_too(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Spheres of the touches' session, without touches of their own, are tested."""
    copy(place / "new.mcap", place / "own-touch.mcap", KNOWN)
    starts = [mark.start_s for mark in read_recording(place / "bare.mcap").marks]
    middle = sorted(starts)[len(starts) // 2]
    copy(place / "bare.mcap", place / "few.mcap", lambda mark: mark.start_s < middle)
    copy(place / "bare.mcap", place / "rest.mcap", lambda mark: mark.start_s >= middle)

    own = run("adapt run --new few.mcap --touches own-touch.mcap --test rest.mcap", capsys)

    assert own["after"] == {"all": own["after"]["sphere"], "sphere": own["after"]["sphere"]}
    assert own["after"]["sphere"] > 0.7
    assert own["not_tested"] == ["cylinder", "rectangle"]  # that they suffered nobody knows


def test_touches_alone_are_tested_as_live_sees_their_session(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before and after are what the two bundles make of the session's volts as measured."""
    copy(place / "held-out.mcap", place / "known.mcap", lambda mark: not SPHERE(mark))
    main(["adapt", "run", "--touches", "touch.mcap", "--test", "known.mcap", "--output", "other"])
    assert "accuracy by window on known.mcap" in capsys.readouterr().out

    found = run("adapt shape.taxel --touches touch.mcap --test known.mcap", capsys)
    history = run("adapt shape.taxel --history", capsys)

    for name, key in (("shape.v1.taxel", "before"), ("shape.taxel", "after")):
        bundle = read_bundle(Path(name))
        data = load_dataset(Path("known.mcap"), replace(bundle.contract.window, reference=None))
        answer = bundle.probabilities(data.windows.values, data.windows.mask).argmax(axis=1)
        right = (answer == data.class_numbers("shape")).mean()
        assert found[key]["all"] == pytest.approx(right, abs=0.02)
        assert history["versions"][1]["change"][key] == found[key]


def test_drift_is_dated_by_the_clock_of_its_own_recording(tmp_path: Path) -> None:
    """Two recordings of a folder began an hour apart; each counts from its own beginning."""
    for name, hour in (("a", 0), ("b", 1)):
        began = int(datetime(2026, 1, 5, 9 + hour).timestamp() * 1e9)
        manifest = replace(Manifest.started_now(SENSOR, now_s=0.0), wall_anchor_ns=began)
        Recorder(tmp_path / f"{name}.mcap", manifest).close()

    assert clock_time(tmp_path, "0123/b#4", 120.0) == "10:02"
    assert clock_time(tmp_path / "a.mcap", "a#0", 60.0) == "09:01"


@pytest.mark.parametrize("trained", ["shape.taxel", "run"])
def test_the_same_touches_twice_make_one_version(
    place: Path, capsys: pytest.CaptureFixture[str], trained: str
) -> None:
    before = digest_of(Path(trained))
    first = run(f"adapt {trained} --touches touch.mcap", capsys)
    main(["adapt", trained, "--touches", "touch.mcap"])
    text = capsys.readouterr().out
    again = run(f"adapt {trained} --touches touch.mcap", capsys)
    back = run(f"adapt {trained} --rollback", capsys)

    assert (first["version"], first["changed"]) == (2, True)
    assert (again["version"], again["changed"]) == (2, False)
    assert "nothing changed" in text
    assert back["number"] == 1
    assert digest_of(Path(trained)) == before


@pytest.mark.parametrize(
    "words", ["--new new.mcap", "--touches touch.mcap", "--correct known.mcap", "--history"]
)
def test_a_kill_between_two_names_is_settled_by_whatever_comes_next(
    place: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    copy(place / "held-out.mcap", place / "known.mcap", lambda mark: not SPHERE(mark))
    rename = os.rename

    def dying(source: Path, target: Path) -> None:
        if Path(target).name == "run":
            raise KeyboardInterrupt
        rename(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", dying)
        with contextlib.suppress(KeyboardInterrupt, SystemExit):
            main(["adapt", "run", "--touches", "touch.mcap"])
    assert not Path("run").exists()
    capsys.readouterr()

    run(f"adapt run {words}", capsys)

    assert Path("run/run.json").exists()
    assert len(run("adapt run --history", capsys)["versions"]) >= 2


def test_a_run_is_adapted_from_inside_its_folder(
    place: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place / "run")

    found = run("adapt . --touches ../touch.mcap", capsys)
    monkeypatch.chdir(place / "run")

    assert found["version"] == 2
    assert run("adapt . --history", capsys)["current"] == 2
    assert (place / "run.v1" / "run.json").exists()


def test_what_was_learned_by_adapting_is_known_to_be_seen_until_it_is_taken_back(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both ways of learning on add to the recordings that the contract names."""
    copy(place / "held-out.mcap", place / "known.mcap", lambda mark: not SPHERE(mark))
    copy(place / "new.mcap", place / "other.mcap", lambda mark: True, gain=1.01)
    before = load_run(Path("run"), weights=False).contract

    run("adapt run --new other.mcap", capsys)
    taught = load_run(Path("run"), weights=False).contract
    run("adapt run --correct known.mcap", capsys)
    corrected = load_run(Path("run"), weights=False).contract
    run("bundle run --output both.taxel --data old", capsys)
    scored = run("evaluate both.taxel known.mcap", capsys)
    main(["evaluate", "both.taxel", "other.mcap"])
    printed = capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["compare", "run", "run", "--test", "known.mcap"])
    refused = capsys.readouterr().err
    run("adapt run --rollback 1", capsys)

    assert set(before.learned) < set(taught.learned) < set(corrected.learned)
    assert len({before.data_digest, taught.data_digest, corrected.data_digest}) == 3
    assert scored["learned_from"] == ["known.mcap"]
    assert "other.mcap" in printed
    assert "neither run was trained on; got known.mcap" in refused
    assert load_run(Path("run"), weights=False).contract.learned == before.learned
