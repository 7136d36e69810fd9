# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Build a graph from an image: the first frame of the embedded tour, or a picture of one's own."""

import sys

import cv2

from adversarial_lcd_ros import BuilderConfig, GraphBuilder, open_sequence

if len(sys.argv) > 1:
    image = cv2.imread(sys.argv[1])
else:
    image = next(open_sequence('bags/flat_tour').frames(0, 1)).image()
graph = GraphBuilder(BuilderConfig(features=200)).build(image, stamp_ns=0)
print(f'{graph.object_count} objects, {graph.node_count - graph.object_count} features, '
      f'{graph.edge_count} edges')
