# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a figure was made with: code, versions, machine.

Digests of the code are part of the keys of finished work, so that a change in what makes a figure
makes it again. They are over whole files: a new comment costs a run, a figure of old code costs
trust.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from functools import lru_cache
import hashlib
from importlib import metadata
from importlib.util import find_spec
import os
from pathlib import Path
import platform
import subprocess
from typing import Any

import cv2

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.errors import ConfigError

# Distributions by the name that is shown; the first that is installed counts.
_DISTRIBUTIONS = {
    'adversarial_lcd_ros': ('adversarial-lcd-ros', 'adversarial_lcd_ros'),
    'numpy': ('numpy',), 'numba': ('numba',), 'scipy': ('scipy',),
    'scikit-learn': ('scikit-learn',),
    'onnxruntime': ('onnxruntime', 'onnxruntime-gpu'), 'rosbags': ('rosbags',),
    'mcap': ('mcap',), 'rclpy': ('ros-jazzy-rclpy', 'rclpy'), 'matplotlib': ('matplotlib',),
    'gtsam': ('gtsam',)}
_HERE = Path(__file__).resolve().parent
_GIT_S = 10.0


def environment() -> dict[str, Any]:
    """Return code, versions and machine; null: not installed."""
    versions = {name: _version(distributions) for name, distributions in _DISTRIBUTIONS.items()}
    return {'code': code_version(),
            'time_utc': datetime.now(timezone.utc).isoformat(timespec='seconds'),
            'python': platform.python_version(), 'versions': {**versions,
                                                              'opencv': cv2.__version__},
            'rmw_implementation': os.environ.get('RMW_IMPLEMENTATION'),
            'system': platform.platform(), 'machine': platform.machine(),
            'processor': _processor(), 'cores': os.cpu_count()}


@lru_cache(1)
def code_version() -> str:
    """Return "git describe" of the checkout that the package lies in, else its version."""
    checkout = _HERE.parent
    if (checkout / 'package.xml').is_file() and (checkout / '.git').exists():
        try:
            found = subprocess.run(
                ['git', '-C', str(checkout), 'describe', '--always', '--dirty', '--tags'],
                capture_output=True, text=True, timeout=_GIT_S, check=True)
            return f'{__version__}, commit {found.stdout.strip()}'
        except (OSError, subprocess.SubprocessError):
            pass  # no git here, or not our checkout to read: the version is what is known
    return __version__


@lru_cache(16)
def code_digest(*places: str) -> str:
    """
    Return the digest of some of this package's sources, hexadecimal.

    Parameters
    ----------
    places : str
        Rooms or modules, as paths below the package: ``attack``, ``graph``,
        ``evaluation/metrics``.

    Raises
    ------
    ValueError
        There is no such room or module.

    """
    digest = hashlib.blake2b(digest_size=16)
    for place in places:
        files = [*sorted((_HERE / place).rglob('*.py')), *_HERE.glob(f'{place}.py')]
        if not files:
            raise ValueError(f'{place} is neither a room nor a module of {_HERE.name}')
        for path in files:
            name, text = path.relative_to(_HERE).as_posix().encode(), path.read_bytes()
            # With their lengths, so that no two lists of files run into the same bytes.
            digest.update(b'%d %s %d ' % (len(name), name, len(text)) + text)
    return digest.hexdigest()


def named_code_digest(name: str) -> str:
    """
    Return the digest of the source of a class of the user's own, ``package.module:Class``.

    Raises
    ------
    ConfigError
        There is no such module, or it has no source file.

    """
    module = name.partition(':')[0]
    try:
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(f'no module {module}')
        return hashlib.blake2b(Path(spec.origin).read_bytes(), digest_size=16).hexdigest()
    except (ImportError, OSError, ValueError) as error:
        raise ConfigError(f'{name}: the source of {module} cannot be read ({error}): expected '
                          'package.module:Class of something that is installed') from error


def _version(distributions: Sequence[str]) -> str | None:
    for name in distributions:
        try:
            return metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return None


def _processor() -> str | None:
    information = Path('/proc/cpuinfo')
    if not information.is_file():
        return platform.processor() or None
    lines = information.read_text(encoding='utf-8', errors='replace').splitlines()
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return names[0] if names else None
