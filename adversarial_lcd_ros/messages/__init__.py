"""What the topics carry: types, their bytes, and the checks between."""
