"""Closures -> map: odometry that drifts, a pose graph, back ends, and how far off they end."""
