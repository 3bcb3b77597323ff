"""What a running station tells other programs: batches over Zenoh, a view for Foxglove."""
