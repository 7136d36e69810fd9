"""Graphs of the past, and how alike their words are."""
