"""What a figure was made with: versions, machine."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from importlib import metadata
import os
from pathlib import Path
import platform
from typing import Any

import cv2

# Distributions by the name that is shown; the first that is installed counts.
_DISTRIBUTIONS = {
    'adversarial_lcd_ros': ('adversarial-lcd-ros', 'adversarial_lcd_ros'),
    'numpy': ('numpy',), 'scipy': ('scipy',), 'scikit-learn': ('scikit-learn',),
    'onnxruntime': ('onnxruntime', 'onnxruntime-gpu'), 'rosbags': ('rosbags',),
    'mcap': ('mcap',), 'rclpy': ('ros-jazzy-rclpy', 'rclpy'), 'matplotlib': ('matplotlib',)}


def environment() -> dict[str, Any]:
    """Return versions and machine; null: not installed."""
    versions = {name: _version(distributions) for name, distributions in _DISTRIBUTIONS.items()}
    return {'time_utc': datetime.now(timezone.utc).isoformat(timespec='seconds'),
            'python': platform.python_version(), 'versions': {**versions,
                                                              'opencv': cv2.__version__},
            'rmw_implementation': os.environ.get('RMW_IMPLEMENTATION'),
            'system': platform.platform(), 'machine': platform.machine(),
            'processor': _processor(), 'cores': os.cpu_count()}


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
