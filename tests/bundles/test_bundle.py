"""A bundle gives what was trained, and a damaged one is refused."""

import errno
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bench.faults.hostile_files import members_of, sealed, zipped
from taxel.bundles import model_trial
from taxel.bundles.contract import Contract, contract_from_json, contract_to_json
from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import Classifier, write_bundle
from taxel.decisions.unknown import Density, NoveltyTest, Unknown
from taxel.errors import BadBundle, RecordingFailed
from taxel.models.cnn2d import Cnn2d
from taxel.signals import SensorInfo
from taxel.training.loop import new_network, predict
from taxel.windows.config import TENG_WINDOW
from taxel.windows.scaling import fit_scaling

RNG = np.random.default_rng(0)
VALUES = (RNG.random((40, 12, 12)) * 3.3).astype(np.float32)
MASK = np.ones((40, 12), bool)


def contract() -> Contract:
    return Contract(
        target="shape",
        classes=("cylinder", "rectangle", "sphere"),
        window=TENG_WINDOW,
        scaling=fit_scaling("full-scale", VALUES, MASK, 3.3),
        channels=tuple(f"s{i}" for i in range(12)),
        units=("V",) * 12,
        rate_hz=1000.0,
        model="cnn2d",
        parameters=5987,
        data_digest="0" * 64,
        accuracy={"session held out": 0.77},
        software="taxel test",
        parity=None,
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    networks = tuple(new_network(lambda: Cnn2d(12, 12, 3), seed) for seed in (0, 1))
    path = tmp_path / "a.taxel"
    write_bundle(path, networks, contract(), VALUES, MASK)
    return path


def test_a_bundle_predicts_what_the_networks_predict(path: Path) -> None:
    bundle = read_bundle(path)
    networks = [new_network(lambda: Cnn2d(12, 12, 3), seed) for seed in (0, 1)]
    scaled = contract().scaling.apply(VALUES, MASK)
    expected = np.mean([predict(network, scaled, MASK) for network in networks], axis=0)

    np.testing.assert_allclose(bundle.probabilities(VALUES, MASK), expected, atol=1e-5)
    assert bundle.contract.parity is not None
    assert bundle.contract.parity < 1e-5
    assert bundle.contract.window == TENG_WINDOW
    assert bundle.contract.classes == contract().classes


def test_writing_twice_gives_the_same_bytes(path: Path, tmp_path: Path) -> None:
    networks = tuple(new_network(lambda: Cnn2d(12, 12, 3), seed) for seed in (0, 1))
    write_bundle(tmp_path / "b.taxel", networks, contract(), VALUES, MASK)

    assert (tmp_path / "b.taxel").read_bytes() == path.read_bytes()


def test_any_flipped_byte_is_found(path: Path) -> None:
    whole = path.read_bytes()
    places = [*range(90), *range(90, len(whole), max(1, len(whole) // 150)), len(whole) - 1]
    for place in places:
        damaged = bytearray(whole)
        damaged[place] ^= 0x10
        path.write_bytes(bytes(damaged))
        with pytest.raises(BadBundle) as caught:
            read_bundle(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [0, 10, 80, 500])
def test_a_file_cut_short_is_refused(path: Path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:size])

    with pytest.raises(BadBundle):
        read_bundle(path)


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_check_windows_that_are_no_numbers_are_refused(path: Path, number: float) -> None:
    """NumPy printed a warning about the arithmetic, and then all probabilities differed."""
    members = members_of(path)
    content = members["check_values.npy"]
    members["check_values.npy"] = content[:-4] + np.float32(number).tobytes()
    path.write_bytes(sealed(zipped(members)))

    with pytest.raises(BadBundle, match="check values that are numbers"):
        read_bundle(path)


def test_a_missing_bundle_says_how_to_write_one(tmp_path: Path) -> None:
    with pytest.raises(BadBundle, match="taxel bundle"):
        read_bundle(tmp_path / "none.taxel")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "recogniser.taxel").touch()
    with pytest.raises(BadBundle, match=r"got \S+run, a run; name \S+run/recogniser.taxel"):
        read_bundle(tmp_path / "run")
    for name in ("slip-both-gels.taxel", "slip-both-gel"):
        with pytest.raises(BadBundle, match=r"comes with taxel, write slip-both-gels"):
            read_bundle(tmp_path / name)


def test_a_full_disk_of_scratch_files_is_blamed_and_not_the_bundle(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(model_trial, "_tried", set())  # else it was tried in another test
    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    with pytest.raises(RecordingFailed, match=r"models in .*; got No space left on device; free"):
        read_bundle(path)


def test_an_export_that_differs_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        Classifier, "forward", lambda self, values, mask: self.networks[0](values, mask).softmax(1)
    )
    real = Classifier.forward
    calls = []

    def drifting(self: Classifier, values, mask):  # type: ignore[no-untyped-def]
        calls.append(1)
        found = real(self, values, mask)
        return found if len(calls) == 1 else found + 0.01

    monkeypatch.setattr(Classifier, "forward", drifting)
    with pytest.raises(BadBundle, match="difference"):
        write_bundle(
            tmp_path / "a.taxel",
            (new_network(lambda: Cnn2d(12, 12, 3), 0),),
            contract(),
            VALUES,
            MASK,
        )
    assert list(tmp_path.iterdir()) == []


def test_a_sensor_with_other_channels_is_refused(path: Path) -> None:
    other = SensorInfo(name="x", channels=("a", "b"), units=("V", "V"), rate_hz=1000.0)

    with pytest.raises(BadBundle, match="12 channels"):
        read_bundle(path).contract.check_sensor(other)


def unknown() -> Unknown:
    rng = np.random.default_rng(3)
    density = Density(
        label="shape",
        projection=rng.normal(size=(36, 2)),
        centres=rng.normal(size=(3, 2)),
        log_share=np.log(np.full(3, 1 / 3)),
        windows=np.sort(rng.normal(size=50)),
        contacts={1: np.sort(rng.normal(size=20)), 4: np.sort(rng.normal(size=20))},
    )
    return Unknown(
        rejected=0.05,
        lag=1,
        level=rng.random(12),
        wander=rng.random(12) + 0.5,
        least=rng.random((2, 12)),
        densities=(density,),
    )


def test_a_bundle_carries_the_test_for_the_unknown(tmp_path: Path) -> None:
    made = replace(contract(), unknown=unknown())
    network = new_network(lambda: Cnn2d(12, 12, 3), 0)
    write_bundle(tmp_path / "a.taxel", (network,), made, VALUES, MASK)
    bundle = read_bundle(tmp_path / "a.taxel")

    found, novelty = bundle.recognise(VALUES[:1], MASK[:1])
    assert bundle.novelty_test is not None
    assert novelty == NoveltyTest(unknown()).of_window(made.scaling.apply(VALUES[:1], MASK[:1])[0])
    np.testing.assert_array_equal(found, bundle.probabilities(VALUES[:1], MASK[:1])[0])


def test_a_window_without_a_measured_row_has_no_novelty_score(tmp_path: Path) -> None:
    networks = (new_network(lambda: Cnn2d(12, 12, 3), 0),)
    path = tmp_path / "a.taxel"
    write_bundle(path, networks, replace(contract(), unknown=unknown()), VALUES, MASK)

    found, novelty = read_bundle(path).recognise(VALUES[:1] * 0, MASK[:1] & False)

    assert found.shape == (3,)
    assert novelty is None


def test_a_bundle_without_the_test_says_so(path: Path) -> None:
    bundle = read_bundle(path)

    assert bundle.novelty_test is None
    assert bundle.recognise(VALUES[:1], MASK[:1])[1] is None


def test_a_bundle_of_before_there_was_such_a_test_is_read() -> None:
    old = json.loads(contract_to_json(contract()))
    del old["unknown"]

    assert contract_from_json(json.dumps(old)).unknown is None


def test_a_bundle_of_a_newer_version_says_to_update() -> None:
    """Writing it again with this version, which does not know its fields, would not help."""
    newer = json.loads(contract_to_json(contract())) | {"warmth": 1.0}

    with pytest.raises(BadBundle) as refused:
        contract_from_json(json.dumps(newer))

    assert "fields unknown to this version: 'warmth'" in refused.value.got
    assert "lacking" not in refused.value.got
    assert "update taxel" in str(refused.value)


def test_a_damaged_test_for_the_unknown_is_refused() -> None:
    data = json.loads(contract_to_json(replace(contract(), unknown=unknown())))
    del data["unknown"]["densities"][0]["centres"]

    with pytest.raises(BadBundle, match="centres"):
        contract_from_json(json.dumps(data))
