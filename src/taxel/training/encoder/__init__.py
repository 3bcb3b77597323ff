"""Pretraining of the touch encoder: videos, what is predicted of them, the loop, the card."""
