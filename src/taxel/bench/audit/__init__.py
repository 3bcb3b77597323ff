"""Rows of `taxel bench audit`: whether results can be believed."""
