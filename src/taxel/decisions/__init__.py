"""From probabilities to answers, or UNKNOWN."""
