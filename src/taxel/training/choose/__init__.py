"""Find the recogniser that an expert would end up with, by validation inside the training part."""
