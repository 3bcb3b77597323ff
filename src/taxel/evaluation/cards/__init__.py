"""What a report says beside a result: its data, its latency, and the published claims."""
