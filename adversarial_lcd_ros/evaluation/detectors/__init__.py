"""Detectors before any attack."""
