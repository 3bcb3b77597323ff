"""Looking at touch: what a gel image says about shape, contact and shear."""
