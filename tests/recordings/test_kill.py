"""A killed recorder loses at most 0.1 s: claimed on real processes and a real kill -9."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from taxel.recordings.reader import read_recording
from taxel.recordings.recovery import recover
from taxel.recordings.writer import part_path

CHILD = Path(__file__).with_name("kill_recorder.py")
KILLS = 20
LARGEST_LOSS_S = 0.1


def kill_once(path: Path, after_scans: int) -> float:
    """Record, kill when so many scans were produced, recover; return the seconds lost."""
    with subprocess.Popen([sys.executable, str(CHILD), str(path)], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        last = -1
        while last < after_scans:
            last = int(child.stdout.readline())
        child.kill()
        last = int((child.stdout.read().split(b"\n")[-2:-1] or [b"%d" % last])[0])
    recovered = path.with_suffix(".saved.mcap")
    recover(part_path(path), recovered)
    numbers = read_recording(recovered).samples.values[:, 0].astype(int)
    np.testing.assert_array_equal(numbers, np.arange(len(numbers)))
    return (last + 1 - len(numbers)) / 1000.0


@pytest.mark.slow
@pytest.mark.data
def test_kill_minus_nine_loses_at_most_a_tenth_of_a_second(tmp_path):
    """Twenty kills at seeded random moments; all that survives is whole and in order."""
    moments = np.random.default_rng(9).integers(60, 500, KILLS)
    lost_s = [kill_once(tmp_path / f"{i}.mcap", int(after)) for i, after in enumerate(moments)]
    print("seconds lost:", sorted(lost_s))
    assert max(lost_s) <= LARGEST_LOSS_S
