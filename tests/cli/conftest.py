"""What tests of verbs share: the one line of a refusal."""

from collections.abc import Callable
from types import ModuleType

import pytest

from taxel.cli.main import main


@pytest.fixture
def unplugged(monkeypatch: pytest.MonkeyPatch) -> Callable[[ModuleType, str], None]:
    """Let the second call of a module's function fail, as where the disk is gone by then."""

    def fail_second(module: ModuleType, name: str) -> None:
        real, calls = getattr(module, name), []

        def broken(*args: object) -> object:
            calls.append(args)
            if len(calls) == 2:
                raise OSError("unplugged")
            return real(*args)

        monkeypatch.setattr(module, name, broken)

    return fail_second


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[[list[str]], str]:
    """Run a command line that must be refused; give the one line that says why."""

    def run(words: list[str]) -> str:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main(words)
        lines = capsys.readouterr().err.splitlines()
        assert end.value.code == 2, lines
        (line,) = [line for line in lines if line.startswith("taxel: ")]
        assert lines[-1] == line
        return line

    return run
