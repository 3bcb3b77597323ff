"""Lets the tests of this folder import the browser and the station that it is shown."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A browser without a screen; its user skips where there is none."""
    from chromium import CHROMIUM, Browser

    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with Browser(tmp_path_factory.mktemp("chromium")) as opened:
        yield opened
