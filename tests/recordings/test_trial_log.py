"""Claims about the log of grasps beside a recording: a disk that refuses takes no line from it."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from taxel.recordings.trial_log import GraspTrial, append_trial, read_trial_log

TRIAL = GraspTrial(number=1, began_s=0.0, ended_s=2.0, alarm="danger", alarm_s=1.0)
LIMITED = """
import resource, signal, sys
from pathlib import Path
from taxel.recordings.trial_log import GraspTrial, append_trial
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
room = int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
try:
    append_trial(Path(sys.argv[1]), GraspTrial(number=2, began_s=3.0, ended_s=4.0))
except OSError:
    print("refused")
"""


def test_a_log_written_before_cameras_were_named_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.trials.csv"
    append_trial(path, replace(TRIAL, cameras="left + right"))
    assert [trial.cameras for trial in read_trial_log(path)] == ["left + right"]
    lines = path.read_text().splitlines()
    path.write_text("".join(f"{line.rpartition(',')[0]}\n" for line in lines))
    append_trial(path, replace(TRIAL, number=2, cameras="left + right"))
    first, second = read_trial_log(path)
    assert (first, second.cameras) == (TRIAL, "left + right")


@pytest.mark.skipif(sys.platform == "win32", reason="needs RLIMIT_FSIZE")
@pytest.mark.parametrize("lines", [0, 1])
def test_a_line_that_does_not_fit_leaves_the_log_as_it_was(tmp_path: Path, lines: int) -> None:
    path = tmp_path / "a.trials.csv"
    for _ in range(lines):
        append_trial(path, TRIAL)
    room = (path.stat().st_size if lines else 0) + 7
    run = subprocess.run([sys.executable, "-c", LIMITED, str(path), str(room)], text=True,
                         capture_output=True, timeout=60, check=True)  # fmt: skip
    assert run.stdout == "refused\n"

    append_trial(path, TRIAL)
    assert read_trial_log(path) == [TRIAL] * (lines + 1)
