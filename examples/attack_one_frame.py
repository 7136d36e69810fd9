# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attack the first frames of the embedded tour; the last is the one on the README's first page."""

from adversarial_lcd_ros import AttackConfig, Attacker, LoopClosureDetector, open_graphs

detector, attacker = LoopClosureDetector(), Attacker(AttackConfig(search='recall'))
for graph in open_graphs('bags/flat_tour@0:0.2528').graphs:
    result = attacker.process(graph, lambda asked: detector.judge(asked).probability)
    before = detector.judge(graph)
    after = detector.detect(result.perturbed)  # judges, then remembers what it was sent
print(f'frame {graph.sequence}: {len(result.flips)} of {graph.edge_count} edges flipped, '
      f'{result.queries} queries')
print(f'probability of a loop: {before.probability:.2f} -> {after.probability:.2f}')
