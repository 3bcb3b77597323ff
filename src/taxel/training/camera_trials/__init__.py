"""Camera trials: features of crops, members of the blend, their weights and their ONNX."""
