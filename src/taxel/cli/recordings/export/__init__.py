"""`taxel export`: one file a format."""
