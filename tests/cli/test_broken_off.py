"""A cross-validation that was killed goes on where it was, to the same bits; outputs have locks."""

import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from forked import Forked, Started
from threadpoolctl import threadpool_limits

from taxel.cli.main import main
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.simulated.data_sets import write_sessions
from taxel.training.run import load_run

TRAIN = ["--epochs", "2", "--fold-count", "3", "--json"]


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """Sums of several threads differ in their last bits from run to run, whoever breaks off."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    with pytest.MonkeyPatch.context() as patched, threadpool_limits(1):
        patched.setenv("OMP_NUM_THREADS", "1")
        yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("broken-off") / "data"
    config = TengHandConfig(rate_hz=100.0, scans_per_class=3000, sessions=3)
    write_sessions(folder, config, lambda _: None)
    return folder


@pytest.fixture(scope="module")
def whole(data: Path) -> Path:
    """A run that nobody broke off."""
    output = data.parent / "whole"
    main(["train", str(data), "--output", str(output), *TRAIN])
    return output


def begun(forked: Forked, words: list[str]) -> Started:
    """Start a real run."""
    return forked.start(words, Path.cwd(), Path("/dev/null"), Path("/dev/null"))


def killed_after(
    forked: Forked, data: Path, output: Path, folds: int, verb: str = "train"
) -> list[Path]:
    """Kill a real run once so many folds are stored; return them."""
    process = begun(forked, [verb, str(data), "--output", str(output), *TRAIN])
    kept = output.with_name(f"{output.name}.folds")
    until_s = time.monotonic() + 300
    while len(found := sorted(kept.glob("*.npz"))) < folds:
        assert process.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < until_s
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.002)
    process.kill()
    process.wait(30)
    return found


def results(run: Path) -> tuple[object, ...]:
    about = json.loads((run / "run.json").read_text())
    about.pop("made")
    files = sorted(path for path in run.iterdir() if path.name != "run.json")
    return about, [(path.name, path.read_bytes()) for path in files]


def test_a_run_killed_after_a_fold_goes_on_from_it_and_ends_with_the_same_bits(
    forked: Forked, data: Path, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    output = tmp_path / "run"
    kept = killed_after(forked, data, output, 1)
    stamps = {path.name: path.stat().st_mtime_ns for path in kept}
    assert not output.exists()
    capsys.readouterr()
    main(["train", str(data), "--output", str(output), *TRAIN])
    assert json.loads(capsys.readouterr().out)["folds_kept"] >= len(stamps)
    assert results(output) == results(whole)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run"]


@pytest.mark.slow
def test_folds_of_another_recipe_other_data_or_damaged_ones_are_not_used(
    forked: Forked, data: Path, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    output = tmp_path / "run"
    first, *_ = killed_after(forked, data, output, 1)
    content = first.read_bytes()

    def used(*words: str, at: Path = data) -> int:
        shutil.rmtree(first.parent, ignore_errors=True)  # a kill may leave a file half written
        first.parent.mkdir()
        first.write_bytes(content)
        capsys.readouterr()
        main(["train", str(at), "--output", str(tmp_path / "run"), *TRAIN, *words])
        return int(json.loads(capsys.readouterr().out)["folds_kept"])

    assert used() == 1
    assert used("--fresh") == 0
    assert used("--seed", "1") == 0
    content = content[:-100] + bytes(100)
    assert used() == 0
    content = b""
    assert used() == 0


@pytest.mark.slow
def test_an_evaluation_keeps_its_folds_too(forked: Forked, data: Path, tmp_path: Path):
    kept = killed_after(forked, data, tmp_path / "checked", 2, verb="evaluate")
    main(["evaluate", str(data), "--output", str(tmp_path / "checked"), *TRAIN])
    assert len(kept) >= 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["checked"]
    assert load_run(tmp_path / "checked", weights=False).predictions is not None


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["train", "evaluate"])
def test_a_second_run_to_the_same_output_is_refused_while_the_first_lives(
    verb: str, forked: Forked, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    output = tmp_path / "run"
    words = ["train", str(data), "--output", str(output), "--epochs", "50", "--json"]
    first = begun(forked, words)
    until_s = time.monotonic() + 120
    while not (tmp_path / ".run.lock").exists() or not (tmp_path / ".run.lock").read_text():
        assert first.poll() is None
        assert time.monotonic() < until_s
        with pytest.raises(subprocess.TimeoutExpired):
            first.wait(0.01)
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main([verb, str(data), "--output", str(output), *TRAIN])
    line = capsys.readouterr().err.strip()
    first.kill()
    first.wait(30)
    assert ended.value.code == 2
    assert line == (
        f"taxel: needed {output} for this process alone; got another that writes it, process "
        f"{first.pid}; wait until it has ended, or choose another --output."
    )
    main([verb, str(data), "--output", str(output), *TRAIN, "--fresh"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run"]


def test_fresh_is_refused_where_it_has_no_use(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    for words in (
        ["train", str(data), "--output", str(tmp_path / "run"), "--no-check", "--fresh"],
        ["evaluate", str(data), "--fresh", "--no-comparators"],
    ):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 2
        assert "--fresh" in capsys.readouterr().err
