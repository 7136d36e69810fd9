"""An hour of faults: what is promised, what came of it, and how often (docs/reliability.md)."""
