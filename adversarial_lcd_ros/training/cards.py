# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a model card says of the sequences and decisions of a training."""

from __future__ import annotations

from typing import Any

import numpy as np

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.environment import environment
from adversarial_lcd_ros.lcd.decision import Decision
from adversarial_lcd_ros.training.decisions import TrainingSequence
from adversarial_lcd_ros.training.sources import TrainingFrames


def sequence_card(source: TrainingFrames, sequence: TrainingSequence) -> dict[str, Any]:
    """Return which frames of a sequence were trained on, on what terms, and their graphs."""
    sizes = np.array([(graph.node_count, graph.edge_count, graph.found_objects)
                      for graph in sequence.graphs], np.float64).mean(axis=0)
    nodes, edges, objects = (float(size) for size in sizes)
    return {'name': source.sequence.name, 'part': [source.source.start, source.source.stop],
            'frames': len(source.numbers), 'first_frame': source.numbers[0],
            'last_frame': source.numbers[-1], 'frames_in_all': source.sequence.frame_count,
            'duration_s': float(source.stamps_ns[-1] - source.stamps_ns[0]) / 1e9,
            'licence': source.licence, 'terms': list(source.terms),
            'nodes_mean': nodes, 'edges_mean': edges, 'objects_mean': objects}


def decision_card(decision: Decision) -> dict[str, Any]:
    """Return the weights of a decision, and how it does on the pairs that it learned from."""
    return {'weights': dict(zip(decision.channels, decision.weights, strict=True)),
            'bias': decision.bias,
            'operating_points': decision.card['operating_points'],
            'training_pairs': [
                {'loops': sequence['loops'], 'others': sequence['others'],
                 'balanced_accuracy': accuracy}
                for sequence, accuracy in zip(decision.card['sequences'],
                                              decision.card['training_balanced_accuracy'],
                                              strict=True)]}


def versions_card() -> dict[str, Any]:
    """Return the releases of Python, of the libraries and of this package."""
    # Neither the time nor the machine: two trainings of the same give the same card.
    found = environment()
    return {'python': found['python'],
            'versions': {**found['versions'], 'adversarial_lcd_ros': __version__}}
