"""Features of frames, labels of frames, and heads that learn from both."""
