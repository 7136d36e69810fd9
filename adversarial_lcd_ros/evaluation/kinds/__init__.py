"""The kinds of results folders."""
