"""Whatever file is given to whatever verb: one plain line, exit code 2, little memory, soon.

Each case runs the command in a process of its own, whose largest memory the system tells: it begins
with what such commands import of others, which counts as its own.
"""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from forked import WITHOUT_TORCH, Forked

from taxel.bench.faults.hostile_cases import ALONE, GROWTH_MB, MOST_MB, RESIDENT, make_world
from taxel.bench.faults.watched_commands import DEADLINE_S, forget_peak, peak_mb, run_alone
from taxel.cli.main import main

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(
        not Path("/proc/self/clear_refs").exists(),
        reason="only Linux says a process's largest memory",
    ),
]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Honest things, and all that is made from them to harm."""
    world = tmp_path_factory.mktemp("hostile")
    make_world(world, main)
    return world


@pytest.fixture(scope="module")
def forked() -> Iterator[Forked]:
    with Forked(WITHOUT_TORCH, {"OMP_NUM_THREADS": "1"}) as found:
        yield found


@pytest.mark.parametrize("name", ALONE)
def test_one_plain_line_exit_code_2_and_little_memory(
    name: str, world: Path, forked: Forked
) -> None:
    found = sorted(world.iterdir())

    ended = forked.run(ALONE[name].split(), world, DEADLINE_S)

    assert ended.refused, ended
    assert ended.memory_mb <= MOST_MB, ended
    assert sorted(world.iterdir()) == found, "something was written"


@pytest.mark.parametrize("name", RESIDENT)
def test_verbs_that_need_pytorch_refuse_alike(
    name: str, world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def hang(*_: object) -> None:
        raise TimeoutError(name)

    monkeypatch.chdir(world)
    found = sorted(world.iterdir())
    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(int(DEADLINE_S))
    held_mb = forget_peak()
    try:
        with pytest.raises(SystemExit) as ended:
            main(RESIDENT[name].split())
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)

    lines = capsys.readouterr().err.strip().splitlines()
    assert ended.value.code == 2
    assert lines[-1].startswith("taxel: needed "), lines
    assert peak_mb() - held_mb <= GROWTH_MB
    assert sorted(world.iterdir()) == found, "something was written"


def test_the_memory_is_measured(world: Path, forked: Forked) -> None:
    """An honest command gives a figure that a process of Python has, forked or begun anew."""
    for ended in (forked.run(["info", "honest"], world), run_alone(["info", "honest"], world)):
        assert ended.code == 0
        assert 20 < ended.memory_mb < MOST_MB
