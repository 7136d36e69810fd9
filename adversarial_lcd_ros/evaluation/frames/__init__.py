"""Many attacks on sampled frames of many sequences: cells, resumable, side by side."""
