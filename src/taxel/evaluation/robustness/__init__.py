"""Robustness curves: predictions when touch, sensor or surroundings get worse."""
