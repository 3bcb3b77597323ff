"""What runs live: one checked file."""
