# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pages of all reports share: templates, embedded pictures, the look of plots."""

from __future__ import annotations

from base64 import b64encode
import io
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

CLEAN_COLOUR = '#2f5d8a'
# Titles are set in them: each has a contrast of at least 4.5 on white.
ATTACK_COLOURS = ('#c0392b', '#9c6400', '#7a4a9c', '#2e8064', '#8c564b', '#5f6b73')
INK, GRID = '#33373d', '#dddfe3'
STYLE = {
    'font.family': 'DejaVu Sans', 'font.size': 9.0, 'axes.edgecolor': '#9aa0a8',
    'axes.labelcolor': INK, 'text.color': INK, 'xtick.color': INK, 'ytick.color': INK,
    'axes.spines.top': False, 'axes.spines.right': False, 'axes.linewidth': 0.8,
    'xtick.major.size': 3.0, 'ytick.major.size': 3.0, 'legend.frameon': False,
    'svg.hashsalt': 'adversarial_lcd_ros'}
WIDE, NARROW = 9.4, 4.4  # inches: for a desktop, and for a phone held upright


def attack_colour(index: int) -> str:
    """Return the colour of an attack by its place in the tables."""
    return ATTACK_COLOURS[index % len(ATTACK_COLOURS)]


def load_template(name: str) -> Any:
    """Return a page of the folder templates; a name it lacks is an error."""
    environment = Environment(loader=PackageLoader('adversarial_lcd_ros.evaluation'),
                              autoescape=True, undefined=StrictUndefined, trim_blocks=True,
                              lstrip_blocks=True)
    return environment.get_template(name)


def data_uri(data: bytes, subtype: str) -> str:
    """Return an image as a link that holds it."""
    return f'data:image/{subtype};base64,{b64encode(data).decode("ascii")}'


def svg(figure: Any) -> bytes:
    """Return a figure as SVG, the same bytes for the same figure."""
    stream = io.BytesIO()
    figure.savefig(stream, format='svg', metadata={'Date': None})
    return stream.getvalue()
