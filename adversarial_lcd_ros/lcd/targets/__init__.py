"""Targets by name (registry.py). A new one is one small file and one line in the table."""

from __future__ import annotations

from pathlib import Path

from adversarial_lcd_ros.lcd.targets.base import Scores, Target
from adversarial_lcd_ros.paths import target_path
from adversarial_lcd_ros.registry import TARGETS

__all__ = ['TARGETS', 'Scores', 'Target', 'decision_path', 'make_target']


def make_target(name: str, network: Path | None = None) -> Target:
    """
    Return the target of that name.

    Parameters
    ----------
    name : str
        In the table, an entry point, or ``package.module:Class``.
    network : Path, optional
        ONNX file of a target that has one; the one that ships if not given.

    Raises
    ------
    ConfigError
        There is no such target.
    ModelError
        The network is missing or damaged.

    """
    found: type[Target] = TARGETS.find(name)
    return found.open(network)


def decision_path(model: str, name: str) -> Path:
    """
    Return the file of a target's trained decision; its network, if it has one, is beside it.

    Parameters
    ----------
    model : str
        The setting ``model`` of the detector.
    name : str
        As for ``make_target``.

    """
    return target_path(model, TARGETS.find(name).name)
