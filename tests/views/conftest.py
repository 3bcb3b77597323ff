"""Lets the tests of this folder import the browser and the station that it is shown."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
