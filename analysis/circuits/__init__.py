"""Davies' circuits, and the legs that reciprocal screws read off them."""
