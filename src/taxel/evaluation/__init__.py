"""Splits that cannot leak, metrics, baselines, cross-validation; a folder for each study."""
