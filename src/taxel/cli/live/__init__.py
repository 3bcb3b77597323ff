"""Verbs of what runs live."""
