"""What a running station sends to other programs: batches over Zenoh, a view for Foxglove."""
