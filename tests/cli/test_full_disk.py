"""A disk that refuses gives one plain line and exit code 2; nothing half-written takes a name."""

import errno
import subprocess
import sys
from pathlib import Path

import pytest
from safetensors import SafetensorError

from taxel.cli.main import main
from taxel.recordings.recovery import recover
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.simulated.data_sets import write_sessions

LIMITED = """
import resource, signal, sys
room = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from taxel.cli.main import main
main(sys.argv[2:])
"""
"""Any verb, with a limit on each file's size, bytes: a real refusal by the operating system."""


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with data, a run and nothing else."""
    folder = tmp_path_factory.mktemp("full-disk")
    config = TengHandConfig(rate_hz=100.0, scans_per_class=3000, sessions=2)
    write_sessions(folder / "data", config, lambda _: None)
    main(["train", str(folder / "data"), "--output", str(folder / "run"), "--epochs", "1",
          "--no-check", "--json"])  # fmt: skip
    return folder


def limited(words: str, room: int, folder: Path) -> str:
    """Run a verb with little room and return its one line."""
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(room), *words.split()],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert (done.returncode, len(lines)) == (2, 1), done.stderr
    assert lines[0].startswith("taxel: needed ")
    return lines[0]


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.mark.skipif(sys.platform == "win32", reason="needs RLIMIT_FSIZE")
def test_simulate_leaves_no_half_data_set(tmp_path: Path):
    line = limited("simulate teng --output set --scans-per-class 4000", 60_000, tmp_path)
    assert "the disk" in line
    assert "recover" not in line  # there would be nothing to recover
    assert "needed room to write set;" in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.data
@pytest.mark.skipif(sys.platform == "win32", reason="needs RLIMIT_FSIZE")
def test_record_keeps_what_fitted_under_the_name_of_a_part(tmp_path: Path):
    words = "record sim://teng?speed=max --output touch.mcap --seconds 120"
    line = limited(words, 400_000, tmp_path)
    assert "recover" in line
    assert files(tmp_path) == ["touch.mcap.part"]
    assert recover(tmp_path / "touch.mcap.part", tmp_path / "saved.mcap").scans > 0


def refused(*_args: object, **_options: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def fails(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(words)
    line = capsys.readouterr().err
    assert ended.value.code == 2
    assert line.startswith("taxel: needed to write ")
    assert line.count("\n") == 1
    return line


def test_a_bundle_is_written_whole_or_not_at_all(
    trained: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    before = files(trained)
    monkeypatch.setattr(Path, "write_bytes", refused)
    words = ["bundle", str(trained / "run"), "--output", str(trained / "a.taxel")]
    assert "No space left" in fails(words, capsys)
    assert files(trained) == before


def test_weights_that_do_not_fit_leave_the_older_run_as_it_was(
    trained: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    before = {name: (trained / name).read_bytes() for name in files(trained)}

    def full(*_args: object, **_options: object) -> None:
        raise SafetensorError("Error while serializing: I/O error: No space left on device")

    monkeypatch.setattr("taxel.models.backbones.weight_files.save_file", full)
    words = ["train", str(trained / "data"), "--output", str(trained / "run"), "--epochs", "1"]
    fails([*words, "--no-check"], capsys)
    assert {name: (trained / name).read_bytes() for name in files(trained)} == before


def test_a_run_that_does_not_fit_leaves_the_older_one_as_it_was(
    trained: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    before = {name: (trained / name).read_bytes() for name in files(trained)}
    monkeypatch.setattr(Path, "write_text", refused)
    words = ["train", str(trained / "data"), "--output", str(trained / "run"), "--epochs", "1"]
    assert "No space left" in fails([*words, "--no-check"], capsys)
    assert {name: (trained / name).read_bytes() for name in files(trained)} == before


@pytest.mark.parametrize("verb", ["bundle", "train"])
def test_an_output_below_a_file_is_one_plain_line(
    verb: str, trained: Path, capsys: pytest.CaptureFixture[str]
):
    """The path runs through a file as if it were a folder."""
    below = trained / "data" / "session-1.mcap" / "deeper"
    before = files(trained)
    words = {
        "bundle": ["bundle", str(trained / "run"), "--output", str(below)],
        "train": [
            "train",
            str(trained / "data"),
            "--recipe",
            "teng",
            "--target",
            "shape",
            "--output",
            str(below),
            "--no-check",
        ],
    }
    fails(words[verb], capsys)
    assert files(trained) == before
