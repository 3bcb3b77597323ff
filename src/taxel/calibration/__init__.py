"""Known forces in, newtons out: curves, noise, drift, and later recordings corrected by them."""
