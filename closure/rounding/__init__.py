"""Files with rounded numbers: what they stand for, and how far what is printed misses it."""
