"""What a GelSight camera sees of a gel; pure physics."""
