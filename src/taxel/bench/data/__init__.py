"""Rows of `taxel bench data`: what `taxel train` reaches by default."""
