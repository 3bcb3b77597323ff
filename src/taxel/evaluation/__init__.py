"""Splits that cannot leak, metrics, baselines, published tables."""
