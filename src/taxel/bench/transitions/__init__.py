"""Rows of `taxel bench transitions`: what a pair of tactile cameras promises."""
