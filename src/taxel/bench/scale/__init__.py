"""Rows of `taxel bench scale`: many workers, large folders, the formats of others."""
