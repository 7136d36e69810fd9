"""Compiled loops that several rooms need."""
