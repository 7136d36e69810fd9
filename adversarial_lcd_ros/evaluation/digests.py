"""Digests by which finished work is told from work to do."""

from __future__ import annotations

from functools import lru_cache
import hashlib
from pathlib import Path

from adversarial_lcd_ros.errors import ModelError


@lru_cache(32)
def file_digest(path: Path) -> str:
    """Return the digest of a model file, hexadecimal; raises ModelError."""
    try:
        return digest_of(path.read_bytes())
    except OSError as error:
        raise ModelError(f'{path} cannot be read: {error.strerror}; name a file that '
                         '"adversarial-lcd train" wrote') from error


def digest_of(data: bytes) -> str:
    """Return the digest of some bytes, hexadecimal."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()
