"""What tests of verbs share: the one line of a refusal."""

from collections.abc import Callable

import pytest

from taxel.cli.main import main


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[[list[str]], str]:
    """Run a command line that must be refused; give the one line that says why."""

    def run(words: list[str]) -> str:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main(words)
        lines = capsys.readouterr().err.splitlines()
        assert end.value.code == 2, lines
        (line,) = [one for one in lines if one.startswith("taxel: ")]
        assert lines[-1] == line
        return line

    return run
