"""Self-motion: the curve of closed postures with the task held."""
