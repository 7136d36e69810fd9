"""Files in and out: bounded readers of what may be hostile, writers of whole files."""
