# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames and ground truth in, from whatever a sequence was published as; a bag out."""

from adversarial_lcd_ros.poses.trajectory import PLACE_INDEX, WORLD, Trajectory
from adversarial_lcd_ros.sequences.frame import Frame
from adversarial_lcd_ros.sequences.importing import (
    GROUND_TRUTH_TOPIC,
    IMAGE_TOPIC,
    ImportSummary,
    import_sequence,
)
from adversarial_lcd_ros.sequences.opening import open_sequence
from adversarial_lcd_ros.sequences.sequence import Sequence

__all__ = ['GROUND_TRUTH_TOPIC', 'IMAGE_TOPIC', 'PLACE_INDEX', 'WORLD', 'Frame', 'ImportSummary',
           'Sequence', 'Trajectory', 'import_sequence', 'open_sequence']
