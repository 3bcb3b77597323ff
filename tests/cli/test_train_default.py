"""`taxel train RECORDINGS` with nothing else: chosen, judged, bundled, live; no hand's gate."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.recordings.importing import ImportRow, import_rows


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two kinds of touch on a foreign array in newtons, three sessions, 20 rows a trial."""
    folder = tmp_path_factory.mktemp("pad")
    rng = np.random.default_rng(0)
    rows = []
    for number in range(18):
        kind, session = number % 2, number // 6
        course = np.linspace(0, 1 + kind, 20)[:, None] * np.array([1.0, 0.5, 0.2])
        values = course + session + rng.normal(0, 0.02, (20, 3))
        file = folder / f"t{number}.csv"
        lines = ["a,b,c", *(",".join(f"{v:.4f}" for v in row) for row in values)]
        file.write_text("\n".join(lines) + "\n")
        rows.append(
            ImportRow(file=file, labels={"push": ("weak", "firm")[kind]},
                      groups={"session": f"s{session}"}, channels="a[N] b[N] c[N]",
                      time="rate:50Hz", sensor="pad")
        )  # fmt: skip
    import_rows(rows, folder / "recordings")
    return folder / "recordings"


@pytest.fixture(scope="module")
def trained(recordings: Path) -> Path:
    run = recordings.parent / "run"
    main(["train", str(recordings), "--output", str(run), "--minutes", "0.02"])
    return run


def test_the_run_holds_what_was_chosen_and_what_it_is_worth(trained: Path):
    about = json.loads((trained / "run.json").read_text())
    choice = json.loads((trained / "expert.json").read_text())

    assert about["contract"]["accuracy"]["session held out"] > 0.9
    assert choice["window"]["gate"] is None
    assert choice["target"] == "push"
    assert choice["leaderboard"]


def test_its_bundle_runs_live(trained: Path, recordings: Path, capsys: pytest.CaptureFixture[str]):
    bundle = trained.with_suffix(".taxel")
    main(["bundle", str(trained), "--output", str(bundle), "--json"])
    parity: Any = json.loads(capsys.readouterr().out)["parity"]
    main(["live", str(bundle), f"replay://{recordings / 't1.mcap'}?speed=max", "--json"])
    (printed,) = json.loads(capsys.readouterr().out)

    assert parity < 1e-5
    assert printed["answers"] == {"firm": 1}


@pytest.mark.parametrize(
    ("words", "need"),
    [
        ("--minutes 0", "--minutes above 0"),
        ("--recipe array --minutes 3", "no recipe, model or window"),
        ("--like nothing.json", "expert.json"),
        ("--split random --target push --max-mb 3", "no recipe, model or window"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(
    words: str, need: str, recordings: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    with pytest.raises(SystemExit) as ended:
        main(["train", str(recordings), "--output", str(tmp_path / "r"), *words.split()])

    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert need in said
    assert not (tmp_path / "r").exists()
