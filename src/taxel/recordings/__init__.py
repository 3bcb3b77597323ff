"""Recordings in MCAP: write, read, recover, import (FORMAT.md)."""
