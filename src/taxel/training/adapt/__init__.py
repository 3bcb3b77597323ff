"""What a trained run still learns: a new class, a person's corrections."""
