# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Targets by name (registry.py). A new one is one small file and one line in the table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from adversarial_lcd_ros.config import ANCHORS, BuilderConfig
from adversarial_lcd_ros.errors import GraphError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.targets.base import Scores, Target
from adversarial_lcd_ros.paths import target_path
from adversarial_lcd_ros.registry import TARGETS

__all__ = ['TARGETS', 'Scores', 'Target', 'builder_for', 'check_variant', 'decision_path',
           'make_target', 'needed_variant']


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


def needed_variant(*names: str) -> str:
    """Return the variant of graphs that one of some targets needs; '' if they take any."""
    variants: list[str] = [TARGETS.find(name).graph_variant for name in names]
    return next(filter(None, variants), '')


def builder_for(config: BuilderConfig, *names: str) -> BuilderConfig:
    """Return the settings of graphs for some targets: what these need wins over ``config``."""
    return replace(config, graph_variant=needed_variant(*names) or config.graph_variant)


def check_variant(target: Target | type[Target], graph: MultiTierGraph) -> None:
    """
    Hold a graph against what a target needs.

    Raises
    ------
    GraphError
        It is of another variant.

    """
    if target.graph_variant == ANCHORS and not graph.has_scene:
        raise GraphError(
            f'target {target.name} needs graphs with a node for the scene, found one without: '
            f'build them with "graph_variant" set to "{ANCHORS}"', cause='graph variant')
