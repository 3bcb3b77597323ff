"""Verbs that make, read, show and check recordings."""
