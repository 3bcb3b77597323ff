"""Other people's files, read by a table that says what each is, as recordings."""
