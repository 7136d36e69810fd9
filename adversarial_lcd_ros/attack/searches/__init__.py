"""Searches by name."""
