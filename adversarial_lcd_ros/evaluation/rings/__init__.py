"""Who can do what, what stops it, and what stops that: attacks beside defences, and posters."""
