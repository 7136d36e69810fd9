"""Where a camera was: trajectories, and the files that hold them."""
