# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Measure how easily graph-based loop closure detection is fooled, over ROS 2.

What a script of one's own needs is here (docs/python.md); each name is loaded when it is first
used, so that importing the package costs nothing, and none of it needs ROS.
"""

from __future__ import annotations

from importlib import import_module
import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from adversarial_lcd_ros.attack.attacker import Attacker, AttackResult
    from adversarial_lcd_ros.config import AttackConfig, BuilderConfig, LabelConfig, LcdConfig
    from adversarial_lcd_ros.evaluation.metrics import measure
    from adversarial_lcd_ros.evaluation.replay.offline import run_offline
    from adversarial_lcd_ros.graph import MultiTierGraph
    from adversarial_lcd_ros.graph_sequences.opening import open_graphs
    from adversarial_lcd_ros.ground_truth.labelling import label_graphs
    from adversarial_lcd_ros.ground_truth.labels import label_frames
    from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
    from adversarial_lcd_ros.sequences import open_sequence
    from adversarial_lcd_ros.vision.builder import GraphBuilder

# onnxruntime from 1.32 on reports to its vendor unless told not to before it is imported. This
# package is what every process of ours, also a worker's, imports first.
os.environ['ORT_DISABLE_TELEMETRY'] = '1'

__version__ = '0.1.0'

_HOME = {
    'Attacker': 'attack.attacker', 'AttackResult': 'attack.attacker',
    'AttackConfig': 'config', 'BuilderConfig': 'config', 'LabelConfig': 'config',
    'LcdConfig': 'config', 'measure': 'evaluation.metrics',
    'run_offline': 'evaluation.replay.offline', 'MultiTierGraph': 'graph',
    'open_graphs': 'graph_sequences.opening', 'label_frames': 'ground_truth.labels',
    'label_graphs': 'ground_truth.labelling',
    'LoopClosureDetector': 'lcd.detector', 'open_sequence': 'sequences',
    'GraphBuilder': 'vision.builder'}

__all__ = ['AttackConfig', 'AttackResult', 'Attacker', 'BuilderConfig', 'GraphBuilder',
           'LabelConfig', 'LcdConfig', 'LoopClosureDetector', 'MultiTierGraph', '__version__',
           'label_frames', 'label_graphs', 'measure', 'open_graphs', 'open_sequence',
           'run_offline']


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = globals()[name] = getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
