"""What every export needs before it starts: recordings, and the packages of its format."""

from __future__ import annotations

from importlib import import_module

from taxel.errors import MissingExtra


def need_packages(*names: str, purpose: str) -> None:
    """Refuse a format whose packages are not installed.

    Raises:
        MissingExtra: One is not.
    """
    for name in names:
        try:
            import_module(name)
        except ModuleNotFoundError as error:
            raise MissingExtra(name, "export", purpose) from error
