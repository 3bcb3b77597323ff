"""Rows of `taxel bench closed-loop`: grips that follow touch."""
