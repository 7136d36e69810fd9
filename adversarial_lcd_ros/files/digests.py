# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Digests by which what is kept is told from what is to be made."""

from __future__ import annotations

from collections.abc import Iterable
import hashlib


def digest_of(data: bytes) -> str:
    """Return the digest of some bytes, hexadecimal."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def digest_of_parts(parts: Iterable[bytes]) -> str:
    """Return the digest of several parts in their order, hexadecimal."""
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        # With its length, so that no two lists of parts run into the same bytes.
        digest.update(len(part).to_bytes(8, 'little') + part)
    return digest.hexdigest()
