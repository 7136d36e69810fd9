# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The ladder of docs/threats.md as one picture: who can do what, what stops it, what stops that.

    python benchmarks/ladder.py docs/figures/ladder.svg
"""

from pathlib import Path
import sys
from textwrap import fill

import matplotlib
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from adversarial_lcd_ros.evaluation.page import STYLE, svg

COLUMNS = ('who', 'changes', 'settings', 'stopped by', 'what is left to him then')
WIDTHS = (2.0, 2.3, 2.3, 2.4, 3.0)
RINGS = (
    ('1  edges', '#f6d5d0', (
        'somebody between builder and detector', 'floor(r n²) edges; nodes are believed',
        'search: stepwise, recall', 'edges made again from nodes (rederive); lengths that agree',
        'nothing; where k is not sure, edges among the nearest')),
    ('2  nodes', '#e8daef', (
        'the same, who knows the rule of edges', 'positions of nodes, or the whole graph',
        'search: move_nodes, replay', 'a seal over payload, stamp and session (key)',
        'to hold graphs back; the process that has the key')),
    ('3  the scene', '#fdebd0', (
        'anybody who may hang a sheet of paper', 'what the camera sees in two places',
        'poster of bag_replay', 'one motion, seen in enough of the frame (geometric_hull)',
        'a larger poster, or two far apart')),
    ('4  the map', '#d6eaf8', (
        'whoever got a loop through', 'the poses around it',
        'evaluate with a map', 'a robust back end', 'closures that agree with each other')))
HEIGHT, GAP = 1.05, 0.18


def draw():
    """Return the picture as SVG."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(12.4, 5.6))
        axes = figure.add_axes((0.01, 0.01, 0.98, 0.98))
        whole = 1.4 + sum(WIDTHS)
        axes.set(xlim=(0, whole), ylim=(-len(RINGS) * (HEIGHT + GAP), 0.6))
        axes.axis('off')
        left = 1.4
        for title, width in zip(COLUMNS, WIDTHS, strict=True):
            axes.text(left + 0.1, 0.25, title, fontsize=10, fontweight='bold', va='center')
            left += width
        for row, (name, colour, cells) in enumerate(RINGS):
            top = -row * (HEIGHT + GAP)
            axes.add_patch(FancyBboxPatch((0.05, top - HEIGHT), whole - 0.1, HEIGHT,
                                          boxstyle='round,pad=0,rounding_size=0.12',
                                          facecolor=colour, edgecolor='none'))
            axes.text(0.2, top - HEIGHT / 2, name, fontsize=11, fontweight='bold', va='center')
            left = 1.4
            for text, width in zip(cells, WIDTHS, strict=True):
                axes.text(left + 0.1, top - HEIGHT / 2, fill(text, int(11.5 * width)),
                          fontsize=9, va='center')
                left += width
        return svg(figure)


if __name__ == '__main__':
    Path(sys.argv[1]).write_bytes(draw())
