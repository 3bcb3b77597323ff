"""Settings of a recipe searched for with Optuna, each outer fold by itself."""
