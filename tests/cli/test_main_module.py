"""python -m taxel runs the command."""

import runpy

import pytest

from taxel import __version__


def test_the_package_runs_as_the_command(capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["taxel", "--version"])
    runpy.run_module("taxel", run_name="__main__")
    assert capsys.readouterr().out == f"{__version__}\n"


def test_with_its_exit_codes(capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["taxel", "inform"])
    with pytest.raises(SystemExit, match="2"):
        runpy.run_module("taxel", run_name="__main__")
    assert capsys.readouterr().err.startswith("taxel: needed a verb of taxel; got 'inform'")
