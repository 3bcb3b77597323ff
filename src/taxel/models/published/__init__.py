"""Weights that others trained and published: where they lie, and how they are brought here."""
