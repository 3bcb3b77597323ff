"""What `taxel bench --full` keeps, and where."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from taxel.bench import rows as kept
from taxel.bench.rows import Row, accuracy_row, store_folder, stored
from taxel.cli.bench import Bench
from taxel.errors import BadInput


def measured(name: str) -> list[Row]:
    return [Row(name=name, value=1.0, unit="s")]


def broken() -> list[Row]:
    raise BadInput("a quiet machine", "a busy one", "measure again")


def test_a_bench_that_breaks_off_keeps_what_it_had_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    bench = SimpleNamespace(
        quick_steps=list,
        full_steps=lambda _: [("first", lambda: measured("first")), ("second", broken)],
        data_digest=lambda _: "0" * 64,
    )
    monkeypatch.setattr("taxel.cli.bench.import_module", lambda _: bench)

    with pytest.raises(BadInput, match="a quiet machine"):
        Bench(name="soak", full=True, store=tmp_path / "new").run()

    (row,) = stored("soak", tmp_path / "new")
    assert (row.name, row.value) == ("first", 1.0)
    assert row.stamp.endswith("taxel bench soak --full --only first")


def test_an_installed_taxel_is_not_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(kept, "STORE", tmp_path / "lib" / "taxel" / "bench" / "stored")

    with pytest.raises(BadInput, match="--store FOLDER"):
        store_folder(None)
    assert store_folder(tmp_path) == tmp_path


def test_in_a_checkout_the_figures_that_ship_are_written():
    assert store_folder(None) == kept.STORE


def test_what_is_asked_for_alone_is_printed_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    bench = SimpleNamespace(
        quick_steps=lambda: [("quick", lambda: measured("quick"))],
        full_steps=lambda _: [("slip's path", lambda: measured("slow"))],
        data_digest=lambda _: "0" * 64,
    )
    monkeypatch.setattr("taxel.cli.bench.import_module", lambda _: bench)
    monkeypatch.setattr(kept, "STORE", tmp_path)
    kept.store("soak", measured("kept before"), "0" * 64, folder=tmp_path)

    for only, full, expected in (
        ("quick", False, ["quick"]),
        ("slip", True, ["slow"]),
        ("", False, ["quick", "kept before", "slow"]),
    ):
        store = tmp_path if full else None
        Bench(name="soak", only=only, full=full, store=store, json=True).run()
        assert [row["name"] for row in json.loads(capsys.readouterr().out)] == expected


def test_a_stamp_is_a_command_that_can_be_read(tmp_path: Path):
    (row,) = kept.store("soak", measured("a"), "0" * 64, only="slip's path", folder=tmp_path)
    assert row.stamp.endswith('taxel bench soak --full --only "slip\'s path"')


def test_an_accuracy_without_a_goal_is_neither_met_nor_missed():
    found = accuracy_row("session held out", 0.5, "of 8 grasps")

    assert found == Row(
        name="session held out", value=0.5, unit="accuracy", goal="", ok=None, note="of 8 grasps"
    )
