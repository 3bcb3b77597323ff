"""Several stations at a glance: reports by MQTT, a table, a page."""
