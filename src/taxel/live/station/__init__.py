"""Live in processes: acquisition, inference, recording, page, and the supervisor over them."""
