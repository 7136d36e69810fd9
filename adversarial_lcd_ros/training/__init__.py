"""Vocabulary, decisions and surrogate data from sequences with ground truth."""
