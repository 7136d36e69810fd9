"""Certificates of a sequence: how much no few flips can turn over."""
