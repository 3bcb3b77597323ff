"""Verbs of boards, cameras, calibration and power."""
