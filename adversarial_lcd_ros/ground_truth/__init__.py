"""What is a loop, from ground truth only."""
