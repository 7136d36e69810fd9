# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an attack takes off the balanced accuracy of a stretch of the tour, without ROS."""

import numpy as np

from adversarial_lcd_ros import (
    AttackConfig,
    LabelConfig,
    LcdConfig,
    label_graphs,
    measure,
    open_graphs,
    run_offline,
)

tour = open_graphs('bags/flat_tour@0:0.5')
stamps = [graph.stamp_ns for graph in tour.graphs]
labels = label_graphs(tour.graphs, tour.trajectory, tour.source, LabelConfig())
for attack in (None, AttackConfig(search='recall')):
    decisions = run_offline(tour.graphs, LcdConfig(), attack)[0].decisions
    match = [stamps.index(decision.match_stamp_ns) if decision.is_loop else -1
             for decision in decisions]
    figures = measure(labels.kind, np.array([decision.is_loop for decision in decisions]),
                      np.array([decision.probability for decision in decisions]),
                      labels.is_correct(range(len(stamps)), match))
    print(f'{attack.perturbation if attack else "clean"}: balanced accuracy '
          f'{figures.balanced_accuracy:.3f}')
