"""A warning of slip: cups to learn from, the noise of followed poses, heads and their ONNX."""
