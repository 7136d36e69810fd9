"""The graphs of a sequence: built once, opened from anywhere."""
