"""How early a warning comes before a loss, how often it is false, and thresholds learned for it."""
