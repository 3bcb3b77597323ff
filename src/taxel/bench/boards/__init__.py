"""Rows of `taxel bench boards`: firmware on emulated boards."""
