"""Following a path of inputs or tip poses, with velocities and accelerations."""
