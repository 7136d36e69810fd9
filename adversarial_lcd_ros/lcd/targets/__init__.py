"""Targets by name. A new one is one small file and one line in TARGETS."""

from __future__ import annotations

from pathlib import Path

from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.lcd.targets.anchored import AnchoredTarget
from adversarial_lcd_ros.lcd.targets.base import Scores, Target, prepare
from adversarial_lcd_ros.lcd.targets.descriptors import DescriptorsTarget
from adversarial_lcd_ros.lcd.targets.edges import EdgesTarget
from adversarial_lcd_ros.lcd.targets.gnn import GnnTarget
from adversarial_lcd_ros.lcd.targets.objects import ObjectsTarget
from adversarial_lcd_ros.lcd.targets.vbow import VbowTarget
from adversarial_lcd_ros.lcd.targets.wl import WlTarget
from adversarial_lcd_ros.lcd.targets.wl_exact import WlExactTarget

TARGETS: dict[str, type[Target]] = {
    target.name: target
    for target in (WlTarget, EdgesTarget, AnchoredTarget, DescriptorsTarget, VbowTarget,
                   ObjectsTarget, WlExactTarget, GnnTarget)
}

__all__ = ['TARGETS', 'Scores', 'Target', 'make_target', 'prepare']


def make_target(name: str, network: Path | None = None) -> Target:
    """
    Return the target of that name.

    Parameters
    ----------
    name : str
    network : Path, optional
        ONNX file of a target that has one (gnn); the one that ships if not given.

    Raises
    ------
    ConfigError
        There is no such target.
    ModelError
        The network is missing or damaged.

    """
    if name not in TARGETS:
        raise ConfigError(f'no target {name!r}; there are: {", ".join(TARGETS)}')
    return GnnTarget(network) if name == GnnTarget.name else TARGETS[name]()
