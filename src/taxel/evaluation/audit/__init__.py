"""Find leakage in recordings and in splits, and say what each leak alone gives."""
