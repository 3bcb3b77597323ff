"""Whatever is changed in a bundle, it opens or is refused in taxel's own words."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gel_monitor import write_gel_monitor
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import changed_bytes, changed_json, changed_npy

from taxel.bench.faults.hostile_files import members_of, sealed, zipped
from taxel.bundles.contract import Contract
from taxel.bundles.envelope import is_grasp_bundle
from taxel.bundles.grasp import read_grasp_bundle, read_grasp_contract
from taxel.bundles.reader import read_bundle, read_contract
from taxel.bundles.shipped import shipped_bundle
from taxel.bundles.versions import history_path, read_history
from taxel.bundles.writer import write_bundle
from taxel.decisions.unknown import Density, Unknown
from taxel.errors import TaxelError
from taxel.models.cnn2d import Cnn2d
from taxel.training.loop import new_network
from taxel.windows.config import TENG_WINDOW
from taxel.windows.reference import Reference
from taxel.windows.scaling import fit_scaling

pytestmark = pytest.mark.data

RNG = np.random.default_rng(0)
VALUES = (RNG.random((4, 12, 12)) * 3.3).astype(np.float32)
MASK = np.ones((4, 12), bool)
FUZZ = settings(
    settings.get_profile("fuzz"),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


def unknown() -> Unknown:
    density = Density(
        label="shape", projection=RNG.normal(size=(36, 2)), centres=RNG.normal(size=(3, 2)),
        log_share=np.log(np.full(3, 1 / 3)), windows=np.sort(RNG.normal(size=5)),
        contacts={1: np.sort(RNG.normal(size=3)), 4: np.sort(RNG.normal(size=3))},
    )  # fmt: skip
    return Unknown(
        rejected=0.05, lag=1, level=RNG.random(12), wander=RNG.random(12) + 0.5,
        least=RNG.random((2, 12)) + 0.1, densities=(density,),
    )  # fmt: skip


def contract() -> Contract:
    scaling = fit_scaling("full-scale", VALUES, MASK, 3.3)
    return Contract(
        target="shape", classes=("cylinder", "rectangle", "sphere"), window=TENG_WINDOW,
        scaling=scaling, channels=tuple(f"s{i}" for i in range(12)), units=("V",) * 12,
        rate_hz=1000.0, model="cnn2d", parameters=5987, data_digest="0" * 64,
        accuracy={"session held out": 0.77}, software="taxel test", parity=None,
        reference=Reference(touches="object=a:3", level=np.ones(12, np.float32)),
        unknown=unknown(),
    )  # fmt: skip


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    path = tmp_path_factory.mktemp("honest") / "a.taxel"
    write_bundle(path, (new_network(lambda: Cnn2d(12, 12, 3), 0),), contract(), VALUES, MASK)
    return members_of(path)


def change_of(name: str, content: bytes) -> st.SearchStrategy[bytes]:
    """Return the strategy that changes a member as its kind can be changed."""
    if name.endswith(".json"):
        return st.one_of(changed_json(json.loads(content)), changed_bytes(content))
    return changed_npy(content) if name.endswith(".npy") else changed_bytes(content)


def changed(data: st.DataObject, members: dict[str, bytes]) -> bytes:
    """Return a bundle with one thing changed: a member, the zip, or the whole file."""
    # Contracts and arrays have more to be wrong in than a model, which is mostly weights.
    names = [n for n in members for _ in range(1 if n.endswith(".onnx") else 3)]
    kind = data.draw(st.sampled_from(("member",) * 8 + ("zip", "file", "lack", "twice")))
    name = data.draw(st.sampled_from(names))
    match kind:
        case "member":
            members = members | {name: data.draw(change_of(name, members[name]))}
        case "lack":
            members = {key: value for key, value in members.items() if key != name}
        case "zip":
            body = zipped(members)
            tail = len(body) - data.draw(st.integers(1, 600))
            return sealed(body[:tail] + data.draw(changed_bytes(body[tail:])))
        case "file":
            return data.draw(changed_bytes(sealed(zipped(members))[:200])) + b"rest"
        case "twice":
            body = zipped(members | {name[:-1] + "?": members[name]})
            return sealed(body.replace(name[:-1].encode() + b"?", name.encode()))
    return sealed(zipped(members))


def tried(read: Callable[[], Any]) -> Any:
    """Return what is read; None where it is refused in taxel's own words, on one line."""
    try:
        return read()
    except TaxelError as error:
        refused = str(error)
    assert "\n" not in refused, refused
    return None


@given(st.data())
@FUZZ
def test_an_array_bundle_opens_or_is_refused(
    tmp_path_factory: pytest.TempPathFactory, honest: dict[str, bytes], data: st.DataObject
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzzed.taxel"
    path.write_bytes(changed(data, honest))

    tried(lambda: read_contract(path))
    bundle = tried(lambda: read_bundle(path))
    is_grasp_bundle(path)

    if bundle is not None:  # then it runs on what its contract says
        shape = (1, bundle.contract.window.steps, len(bundle.contract.channels))
        found, novelty = bundle.recognise(np.ones(shape, np.float32), np.ones(shape[:2], bool))
        assert found.shape == (len(bundle.contract.classes),)
        assert bundle.novelty_test is None or novelty is not None or not np.isfinite(found).all()


@pytest.fixture(scope="module", params=["a forecast of slip", "windows of gel features"])
def grasp(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, bytes]:
    path = tmp_path_factory.mktemp("grasp") / "b.taxel"
    if request.param == "a forecast of slip":
        path = shipped_bundle("cup-pour")
    else:
        write_gel_monitor(path)
    return members_of(path)


@given(st.data())
@settings(FUZZ, max_examples=FUZZ.max_examples // 2)
def test_a_grasp_bundle_opens_or_is_refused(
    tmp_path_factory: pytest.TempPathFactory, grasp: dict[str, bytes], data: st.DataObject
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzzed-grasp.taxel"
    path.write_bytes(changed(data, grasp))

    is_grasp_bundle(path)
    tried(lambda: read_grasp_contract(path))
    bundle = tried(lambda: read_grasp_bundle(path))

    if bundle is not None:
        window = np.ones((bundle.contract.frames, *bundle.offset.shape), np.float32)
        with np.errstate(all="ignore"):  # an offset or factor may be huge
            window = (window - bundle.offset) * bundle.factor
        found = bundle.probability(window)
        assert 0 <= found <= 1 if np.isfinite(window).all() else np.isnan(found)


HISTORY = {
    "format": 1,
    "versions": [
        {
            "number": 1, "digest": "0" * 64, "parent": "", "made": "",
            "change": {"what": "trained", "data": ["a"], "data_digest": "", "before": {},
                       "after": {"accuracy": 0.5}},
        }
    ],
}  # fmt: skip


@given(text=st.one_of(changed_json(HISTORY), changed_bytes(json.dumps(HISTORY).encode())))
@settings(FUZZ, max_examples=FUZZ.max_examples // 4)
def test_a_history_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, text: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "kept.taxel"
    path.write_bytes(b"x")
    history_path(path).write_bytes(text)

    history = tried(lambda: read_history(path))

    if history is not None:
        digest = hashlib.sha256(b"x").hexdigest()
        assert history.version(history.current).digest == digest


def test_the_honest_bundle_is_opened(honest: dict[str, bytes], tmp_path: Path) -> None:
    """Otherwise nothing above would be tried."""
    (tmp_path / "a.taxel").write_bytes(sealed(zipped(honest)))

    opened = read_bundle(tmp_path / "a.taxel").contract
    assert opened.classes == contract().classes
    assert replace(opened, parity=None).window == TENG_WINDOW
