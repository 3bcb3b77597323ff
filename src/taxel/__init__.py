"""Raw touch to a decision in real time, with numbers one can believe."""

import os
from importlib.metadata import version

# ONNX Runtime 1.32 keeps a device ID for usage statistics, unless this is set before its import.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

__version__ = version("taxel")
"""The installed version of taxel."""
