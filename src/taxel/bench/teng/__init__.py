"""Rows of `taxel bench teng`: what the TENG hand's system promises."""
