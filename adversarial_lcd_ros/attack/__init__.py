"""Perturbing a graph within a query and an edit budget."""
