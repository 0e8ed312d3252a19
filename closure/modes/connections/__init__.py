"""Which modes are joined without a singularity in a slice, and which meet at one."""
