"""Mutation testing of the places where a wrong line costs most: `make mutants`."""
