"""Measured figures beside their goals."""
