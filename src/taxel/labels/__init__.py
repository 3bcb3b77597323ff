"""What may be learned from a recording, and what must stay together."""
