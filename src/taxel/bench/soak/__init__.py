"""Rows of `taxel bench soak`: a station that runs for an hour."""
