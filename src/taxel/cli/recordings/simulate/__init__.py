"""`taxel simulate`: one file a simulated sensor."""
