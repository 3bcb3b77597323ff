"""One training loop, recipes, checkpoints, runs."""
