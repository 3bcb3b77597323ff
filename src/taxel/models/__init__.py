"""Networks and library baselines."""
