"""The wire format between a board and the host: frames, checks, messages."""
