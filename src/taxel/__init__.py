"""Raw touch to a decision in real time, with numbers one can believe."""

from importlib.metadata import version

__version__ = version("taxel")
"""The installed version of taxel."""
