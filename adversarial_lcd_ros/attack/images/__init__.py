"""Attacks on pictures, before any graph is built: what somebody puts into the scene."""
