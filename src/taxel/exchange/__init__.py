"""Other people's formats: what a recording becomes in them, and back."""
