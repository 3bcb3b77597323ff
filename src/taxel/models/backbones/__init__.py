"""Image networks that turn one gel frame into features."""
