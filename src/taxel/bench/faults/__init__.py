"""Rows of `taxel bench faults`: what goes wrong, how soon it shows, what is lost."""
