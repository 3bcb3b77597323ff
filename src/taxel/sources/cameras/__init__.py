"""Tactile cameras and a camera that looks on."""
