"""Whole camera trials: their splits, models beside trivial controls, and the slip signal alone."""
