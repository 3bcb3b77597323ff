"""Runs the command, as python -m taxel."""

from taxel.cli.main import main

if __name__ == "__main__":
    main()
