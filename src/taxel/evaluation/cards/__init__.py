"""What a report says beside a result: data, latency, people's reactions, the published claims."""
