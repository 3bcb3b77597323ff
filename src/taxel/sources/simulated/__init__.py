"""Simulators as live sources and as data sets."""
