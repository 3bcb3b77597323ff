"""Simulated sensors: pure physics, no files."""
