"""What a recogniser gains from a few touches of a new class, a new day or another pad."""
