"""A run's folder that cannot be read is one plain line."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.bundles.contract import Contract
from taxel.errors import BadInput, RecordingFailed
from taxel.training.curves import Epoch
from taxel.training.loop import TrainConfig
from taxel.training.run import Run, load_run, save_run
from taxel.windows.config import WindowConfig
from taxel.windows.scaling import fit_scaling


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    values = np.ones((4, 6, 4), np.float32)
    contract = Contract(
        target="shape", classes=("a", "b"), window=WindowConfig(steps=6, stride=6),
        scaling=fit_scaling("standard", values, np.ones((4, 6), bool), None),
        channels=tuple("abcd"), units=("V",) * 4, rate_hz=100.0, model="cnn2d", parameters=1,
        data_digest="0" * 64, accuracy={}, software="taxel test", parity=None,
    )  # fmt: skip
    epoch = Epoch(**dict.fromkeys(Epoch.__dataclass_fields__, 1))
    run = Run(networks=(), contract=contract, train=TrainConfig(), history=(epoch,), data="data")
    save_run(tmp_path / "run", run)
    return tmp_path / "run"


def test_a_run_without_weights_comes_back_for_those_who_read_results(folder: Path) -> None:
    assert load_run(folder, weights=False).data == "data"


@pytest.mark.parametrize(
    "damage",
    [
        lambda about: about.pop("train"),
        lambda about: about["train"].pop("augment"),
        lambda about: about["train"].update(unheard_of=1),
        lambda about: about.pop("history"),
        lambda about: about["history"][0].update(unheard_of=1),
        lambda about: about["history"][0].clear(),
        lambda about: about["made"].update(unheard_of=1),
        lambda about: about.update(made="text"),
        lambda about: about.update(trivial=3),
        lambda about: about.pop("data"),
    ],
)
def test_unknown_and_missing_fields_are_one_plain_line(
    folder: Path, damage: Callable[[dict[str, Any]], object]
) -> None:
    about = json.loads((folder / "run.json").read_text())
    damage(about)
    (folder / "run.json").write_text(json.dumps(about))

    with pytest.raises(BadInput, match="a run in") as found:
        load_run(folder, weights=False)
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(("name", "kind"), [("cup.taxel", "a bundle"), ("run.json", "a file")])
def test_a_file_in_a_run_s_place_is_refused_with_where_runs_are(
    tmp_path: Path, name: str, kind: str
) -> None:
    """A bundle has no predictions to compare: the message says which folder has them."""
    (tmp_path / name).write_bytes(b"{}")
    with pytest.raises(BadInput) as found:
        load_run(tmp_path / name)

    assert found.value.needed == "a run's folder"
    assert found.value.got == f"{tmp_path / name}, {kind}"
    assert "runs/DATA-TARGET" in found.value.mend


@pytest.mark.parametrize("broken", [OSError(5, "Input/output error"), KeyboardInterrupt()])
def test_a_run_that_takes_an_older_one_s_place_loses_neither_where_that_breaks_off(
    folder: Path, monkeypatch: pytest.MonkeyPatch, broken: BaseException
) -> None:
    """At any moment one of both has the name, or a hidden folder from which it gets it back."""
    run, real, calls = load_run(folder, weights=False), os.replace, list[object]()

    def replace_once(source: str, target: str) -> None:
        calls.append(target)
        if len(calls) == 2:
            raise broken
        real(source, target)

    monkeypatch.setattr(os, "replace", replace_once)
    with pytest.raises((RecordingFailed, KeyboardInterrupt)):
        save_run(folder, replace(run, data="newer"))

    assert load_run(folder, weights=False).data == "newer"
    assert [path.name for path in folder.parent.iterdir()] == [folder.name]
