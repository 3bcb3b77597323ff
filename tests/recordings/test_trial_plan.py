"""Claims about plans of trials: what is to be recorded, what is done, what is refused."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.recordings.manifest import Manifest
from taxel.recordings.trial_plan import balance_line, done_of, read_plan
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo

PLAN = """# two objects
group:session,group:object,label:shape,times
monday,ball,sphere,2

monday,jar,cylinder,1
"""
PAD = SensorInfo(name="pad", channels=("a",), units=("V",), rate_hz=100.0)


def written(folder: Path, text: str) -> Path:
    path = folder / "plan.csv"
    path.write_text(text, encoding="utf-8")
    return path


def record(path: Path, labels: dict[str, str], groups: dict[str, str]) -> None:
    with Recorder(path, Manifest(sensor=PAD, labels=labels, groups=groups)) as recorder:
        recorder.write(Samples.from_values(np.ones((5, 1)), np.arange(5) / 100.0))
        recorder.close()


def test_each_line_becomes_so_many_trials_in_order(tmp_path: Path):
    trials = read_plan(written(tmp_path, PLAN))

    assert [trial.file_name for trial in trials] == [f"trial-00{n}.mcap" for n in (1, 2, 3)]
    assert [trial.labels["shape"] for trial in trials] == ["sphere", "sphere", "cylinder"]
    assert trials[2].groups == {"session": "monday", "object": "jar", "trial_number": "3"}
    assert trials[2].words == "session monday, object jar, shape cylinder"


def test_what_is_recorded_is_done_and_the_balance_says_so(tmp_path: Path):
    trials = read_plan(written(tmp_path, PLAN))
    record(tmp_path / trials[1].file_name, dict(trials[1].labels), dict(trials[1].groups))
    (tmp_path / "trial-003.mcap.part").write_bytes(b"half")
    done = done_of(trials, tmp_path)

    assert [trial.number for trial in done] == [2]
    assert balance_line(trials, done) == (
        "1 of 3 trials; object: ball 1/2, jar 0/1; shape: sphere 1/2, cylinder 0/1"
    )


def test_a_recording_of_another_plan_is_not_taken_for_one_of_this(tmp_path: Path):
    trials = read_plan(written(tmp_path, PLAN))
    record(tmp_path / trials[0].file_name, {"shape": "rectangle"}, dict(trials[0].groups))

    with pytest.raises(BadInput, match="another trial"):
        done_of(trials, tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "nothing"),
        ("times\n3\n", "a first line of label:NAME"),
        ("shape,times\nsphere,2\n", "'shape'"),
        ("label:shape,label:shape\na,b\n", "each once"),
        ("label:shape,label: shape\na,b\n", "each once"),
        ("# of Monday\n\nlabel:shape,times\nsphere,many\n", "line 4"),
        ("label:shape,times\n" + 140_000 * "x" + ",1\n", "a table"),
        ("label:shape,times\nsphere,many\n", "'many'"),
        ("label:shape,times\nsphere," + 5000 * "9" + "\n", "times of 1 to 9999"),
        ("label:shape,times\nsphere\n", "2 cells"),
        ("label:shape,times\n,2\n", "none empty"),
        ("label:shape,times\n", "1 to 9999 trials"),
        ("label:shape,times\nsphere,9999\ncube,9\n", "1 to 9999 trials"),
    ],
)
def test_a_plan_that_cannot_be_followed_is_refused_in_one_line(
    text: str, words: str, tmp_path: Path
):
    with pytest.raises(BadInput, match=words):
        read_plan(written(tmp_path, text))


def test_a_plan_that_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(BadInput, match=r"needed the plan .*none\.csv; got no such file"):
        read_plan(tmp_path / "none.csv")
