"""Camera image -> multi-tier graph: features, words, objects."""
