"""`taxel report`: from a training to a page, from stored rows to the card of claims."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import tyro

from taxel.bench import claims_card as card
from taxel.bench.claims_card import all_parts
from taxel.bench.rows import Row
from taxel.cli.evaluation.report import Report
from taxel.cli.recordings.simulate.teng import Teng
from taxel.cli.training.train import Train
from taxel.errors import BadInput
from taxel.evaluation.cards.claims import table_row
from taxel.evaluation.teng.table_4_1 import ROWS

CARD = Path(__file__).parents[2] / "docs" / "reference" / "claims.md"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with recordings in data/ and a run in run/."""
    folder = tmp_path_factory.mktemp("made")
    words = ["--output", str(folder / "data"), "--scans-per-class", "3000"]
    tyro.cli(Teng, args=[*words, "--sessions", "3", "--json"]).run()
    words = [str(folder / "data"), "--output", str(folder / "run"), "--epochs", "1"]
    tyro.cli(Train, args=[*words, "--fold-count", "3", "--json"]).run()
    return folder


def report(*words: str | Path) -> None:
    tyro.cli(Report, args=[str(word) for word in words]).run()


def test_a_trained_run_becomes_a_page(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    page = tmp_path / "new" / "report.html"
    capsys.readouterr()  # what the fixture printed
    report(made / "run", "--output", page, "--json")

    assert json.loads(capsys.readouterr().out) == {"written": [str(page)], "replaced": []}
    page_text = page.read_text(encoding="utf-8")
    for part in ("data", "split", "results", "runs", "latency", "made"):
        assert f'<h2 id="{part}"' in page_text, part
    assert "temperature_c" in page_text
    assert "not those of the run" not in page_text
    assert not list(page.parent.glob("*.part"))


def test_a_page_is_made_though_the_recordings_are_gone(made: Path, tmp_path: Path):
    shutil.copytree(made / "run", tmp_path / "run")
    about = tmp_path / "run" / "run.json"
    about.write_text(about.read_text().replace(str(made / "data"), "elsewhere"))
    report(tmp_path / "run", "--no-latency", "--output", tmp_path / "r.html")

    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "not at hand" in page
    assert '<h2 id="latency"' not in page


def test_other_recordings_than_the_runs_are_noted_in_one_line(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """The page alone said so; the same recordings in another place are no others."""
    data = shutil.copytree(made / "data", tmp_path / "data")
    capsys.readouterr()
    words = [made / "run", "--no-latency", "--output", tmp_path / "r.html", "--data", data]
    report(*words)
    assert "note" not in capsys.readouterr().err

    (data / "session-3.mcap").unlink()
    report(*words)
    line = " ".join(capsys.readouterr().err.split())
    assert line.startswith(f"note: {data} holds other recordings than those of run;")


@pytest.mark.slow
def test_the_audit_of_a_run_is_on_its_page(made: Path, tmp_path: Path):
    report(made / "run", "--audit", "--no-latency", "--output", tmp_path / "r.html")

    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert '<h2 id="audit"' in page
    assert "session held out" in page


def test_the_audit_takes_the_sides_that_the_run_was_tested_on(made: Path):
    from taxel.evaluation.audit.of_run import sides_of
    from taxel.evaluation.audit.reading import read_touch
    from taxel.training.run import load_run

    run = load_run(made / "run", weights=False)
    touch = read_touch(made / "data", "shape", lambda *_: None)
    assert run.predictions is not None
    pieces, sides = sides_of(run.predictions, touch, 12)

    sessions = touch.group("session")[pieces.trial]
    assert sides.claimed == ("session",)
    assert len(sides.folds) == 3
    for train, test in sides.folds:
        assert len(set(sessions[test])) == 1
        assert not set(sessions[train]) & set(sessions[test])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "a file to write"),
        (["--output", "r.html"], "at least one run"),
        (["nowhere", "--output", "r.html"], "a run in"),
        (
            ["--tables", "nowhere.json", "--output", "r.html"],
            r"JSON in nowhere\.json; got no such file",
        ),
        (["--keep", "a.json", "--output", "r.html", "--tables", "b.json"], "--claims FILE"),
        (["--claims", "."], "a file to write"),
    ],
)
def test_what_cannot_be_reported_is_refused_in_one_line(
    words: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput, match=message):
        report(*words)

    assert not list(tmp_path.iterdir())


def test_an_older_page_is_replaced_and_that_is_said(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = [made / "run", "--no-latency", "--output", tmp_path / "r.html"]
    report(*words)
    assert ", replaced" not in capsys.readouterr().out
    report(*words)

    assert "r.html, replaced" in capsys.readouterr().out


def test_what_is_no_page_is_never_replaced_by_one(made: Path, tmp_path: Path):
    kept = tmp_path / "session.mcap"
    kept.write_bytes(b"a recording")
    with pytest.raises(BadInput, match="holds something else"):
        report(made / "run", "--output", kept)

    assert kept.read_bytes() == b"a recording"


@pytest.mark.parametrize("name", ["report.pdf", "report"])
def test_a_page_ends_in_html(name: str, made: Path, tmp_path: Path):
    with pytest.raises(BadInput, match=r"ends in \.html"):
        report(made / "run", "--output", tmp_path / name)

    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["--audited", "--sweep", "--tables"])
@pytest.mark.parametrize("content", [b"\x80\x81", b"[1, 2]", b"3", b'{"a": 1}', b"[]"])
def test_a_file_of_another_kind_is_refused_without_words_of_python(
    option: str, content: bytes, made: Path, tmp_path: Path
):
    file = tmp_path / "x.json"
    file.write_bytes(content)
    with pytest.raises(BadInput, match=r"x\.json") as error:
        report(made / "run", "--no-latency", option, file, "--output", tmp_path / "r.html")

    message = str(error.value)
    assert not [word for word in ("codec", "object", "indices", "must be", "'") if word in message]


def test_an_adapted_run_shows_its_versions_and_what_they_are_worth(made: Path, tmp_path: Path):
    from taxel.bundles.versions import Change, new_path, replace_with
    from taxel.training.run import load_run, save_run

    run = tmp_path / "run"
    shutil.copytree(made / "run", run)
    checked = load_run(run).contract.accuracy["session held out"]
    adapted = replace(load_run(run), predictions=None, trivial={})
    save_run(new_path(run), replace(adapted, contract=replace(adapted.contract, accuracy={})))
    replace_with(run, new_path(run), Change(
        what="5 corrected grasps", before={"all": 0.5, "sphere": 0.25},
        after={"all": 0.7512, "sphere": 0.5}))  # fmt: skip
    report(run, "--no-latency", "--output", tmp_path / "r.html")

    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<b>75.1 %</b><span>run, version 2, when adapted</span>" in page
    assert f"session held out: {100 * checked:.1f} %" in page
    assert "50.0 % → 75.1 %" in page
    assert "sphere 25.0 % → 50.0 %" in page


def test_the_same_run_twice_is_refused(made: Path, tmp_path: Path):
    with pytest.raises(BadInput, match="each run once"):
        report(made / "run", made / "run", "--output", tmp_path / "r.html")


def test_the_card_in_the_docs_is_what_the_command_writes_now(tmp_path: Path):
    """Where this fails, run: taxel report --claims docs/reference/claims.md."""
    report("--claims", tmp_path / "claims.md")

    assert CARD.read_text(encoding="utf-8") == (tmp_path / "claims.md").read_text(encoding="utf-8")


def test_every_row_of_table_4_1_and_of_tables_1_to_3_is_on_the_card():
    what = [claim.what for part in all_parts() for claim in part.claims]

    for row in ROWS:
        assert f"1D CNN: {row}" in what
        assert f"2D CNN: {row}" in what
    assert sum("k = " in claim for claim in what) == 10
    assert sum(claim.endswith(": parameters") for claim in what) == 11


def test_a_claim_without_a_row_says_so_and_why():
    table = card.claims_card(rows=[])

    assert "98.90 % | not measured" in table
    assert "its weights can be distilled (taxel distil), no row is stored yet" in table
    assert "sees no light" in table


@pytest.mark.parametrize("command", [
    "taxel reproduce table-4-1", 'taxel bench teng --full --only "the paper\'s set, tables"',
])  # fmt: skip
def test_a_stored_row_fills_its_cell_and_names_its_command(command: str):
    name = table_row("honest", "shape", "session held out", "cnn2d", "Test Accuracy")
    stamp = f"commit abc, 2026-01-01, {command}"
    row = Row(name=name, value=0.7654, unit="of 1", goal="", ok=None, stamp=stamp)

    table = card.claims_card(rows=[row])

    (line,) = (line for line in table.splitlines() if "2D CNN: Test Accuracy" in line)
    assert line.split(" | ")[2:] == ["0.9983", "–", "shape 0.7654",
                                     f"`{command}` |"]  # fmt: skip
    assert f"- commit abc, 2026-01-01, `{command}`" in table


def test_a_link_with_a_star_finds_its_row_whatever_the_levels_are():
    name = "sim, new sessions, shape by windows, wider training, 9 rows: dust 0 … 0.5 share, points lost at worst"  # noqa: E501
    row = Row(name=name, value=1.26, unit="points", goal="<= 2", ok=True)
    other = Row(name=name.replace("windows", "whole grasps"), value=9.0, unit="points", goal="",
                ok=None)  # fmt: skip

    thesis = replace(
        row, name=name.replace("wider training, 9 rows", "the thesis's setting"), value=20.0
    )

    table = card.claims_card(rows=[other, thesis, row])

    (line,) = (line for line in table.splitlines() if "dust on the objects" in line)
    assert "| above 95 % | – | shape 1.3 points, thesis's shape 20.0 points |" in line


def test_results_are_kept_as_rows_and_a_later_one_replaces_an_earlier(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(card, "STORE", tmp_path)
    monkeypatch.setattr("taxel.bench.rows.STORE", tmp_path)
    column = {"rows": dict.fromkeys(ROWS, 0.5) | {"Test Loss": None},
              "pooled": {"scores": {"accuracy": 0.6}, "interval": [0.5, 0.7]}}  # fmt: skip
    section = {"preset": "honest", "task": "shape", "split": "session held out",
               "columns": {"cnn2d": column},
               "trivial": {"majority": 0.3, "channel means": 0.7}}  # fmt: skip

    assert card.keep_for_claims({"t.json": [section]}) == len(ROWS) + 1
    column["rows"]["Test Accuracy"] = 0.75
    card.keep_for_claims({"t.json": [section]})

    rows = {row.name: row.value for row in card.all_stored()}
    assert len(rows) == len(ROWS) + 1
    assert (
        rows["Table 4.1, honest recordings, shape, session held out, trivial baselines: best"]
        == 0.7
    )
    name = table_row("honest", "shape", "session held out", "cnn2d", "Test Accuracy")
    assert rows[name] == 0.75


def test_only_results_that_are_known_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(card, "STORE", tmp_path)
    with pytest.raises(BadInput, match=r"x\.json"):
        card.keep_for_claims({"x.json": {"a": 1}})

    assert not list(tmp_path.iterdir())


def test_a_network_without_trained_weights_has_no_accuracy_on_the_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(card, "STORE", tmp_path)
    monkeypatch.setattr("taxel.bench.rows.STORE", tmp_path)
    scores = {"accuracy": 0.97, "interval": [0.9, 0.99]}
    row = {"plan": {"model": "densenet121+lstm", "frames": 8}, "weights": "RANDOM",
           "single": scores, "every_cup": scores}  # fmt: skip
    step = {"model": "densenet121+lstm", "frames": 8, "engine": "ort", "threads": 1,
            "stream_ms": 20.0}  # fmt: skip
    tables = {"rule": "change", "rows": [row], "baselines": [], "steps": [step]}

    assert card.keep_for_claims({"t.json": tables}) == 1
    assert [row.unit for row in card.all_stored()] == ["ms"]


def test_a_distilled_networks_accuracy_says_so_on_the_card(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """And its row says how it was trained, and what computed its features."""
    monkeypatch.setattr(card, "STORE", tmp_path)
    monkeypatch.setattr("taxel.bench.rows.STORE", tmp_path)
    scores = {"accuracy": 0.97, "interval": [0.9, 0.99]}
    row = {"plan": {"model": "resnet101+lstm", "frames": 8}, "weights": "file:a.safetensors",
           "origin": "taxel distil, answers of resnet50", "single": scores,
           "every_cup": None}  # fmt: skip
    tables = {"rule": "change", "rows": [row], "baselines": [], "steps": [],
              "features": "openvino bf16"}  # fmt: skip
    card.keep_for_claims({"t.json": tables})

    (kept,) = card.all_stored()
    assert kept.note.endswith(
        "weights file:a.safetensors taxel distil, answers of resnet50; features by openvino bf16"
    )
    (line,) = (line for line in card.claims_card().splitlines()
               if "resnet101 + lstm: accuracy" in line)  # fmt: skip
    assert "| 95.58 % | distilled 97.0 % | – |" in line


def test_a_network_trained_end_to_end_is_not_called_distilled_for_what_it_began_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(card, "STORE", tmp_path)
    monkeypatch.setattr("taxel.bench.rows.STORE", tmp_path)
    row = {"plan": {"model": "resnet101+lstm", "frames": 8}, "weights": "file:a.safetensors",
           "origin": "taxel train-backbone, end to end, from file:b.safetensors (taxel distil)",
           "single": {"accuracy": 0.97, "interval": [0.9, 0.99]}, "every_cup": None}  # fmt: skip
    card.keep_for_claims({"t.json": {"rule": "change", "rows": [row], "baselines": [],
                                     "steps": []}})  # fmt: skip
    assert "| 95.58 % | end to end 97.0 % | – |" in card.claims_card()
