"""Networks of images that are trained here: distilled, or end to end."""
