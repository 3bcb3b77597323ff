"""Trials out of files of arrays: axes, channels, members."""
