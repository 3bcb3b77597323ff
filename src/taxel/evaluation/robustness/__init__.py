"""Robustness curves: what a recogniser still tells when touch, sensor or surroundings get worse."""
