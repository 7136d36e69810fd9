# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts of published recordings, each in a module of its own, and the table of them."""

from __future__ import annotations

from pathlib import Path

from adversarial_lcd_ros.sequences.layouts import euroc, kitti, matrices, openloris
from adversarial_lcd_ros.sequences.layouts.base import Layout, Options

__all__ = ['LAYOUTS', 'Layout', 'Options', 'find_layout']

LAYOUTS: tuple[Layout, ...] = (euroc.LAYOUT, kitti.LAYOUT, openloris.LAYOUT, *matrices.LAYOUTS)


def find_layout(path: Path) -> tuple[Layout, Path, str | None] | None:
    """Return the layout of a folder, the folder of the recording, and the camera it names."""
    for layout in LAYOUTS:
        found = layout.find(path)
        if found is not None:
            return layout, *found
    return None
