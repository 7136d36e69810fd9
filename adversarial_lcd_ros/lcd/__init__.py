"""Graphs -> loop closures: database, targets, decision."""
