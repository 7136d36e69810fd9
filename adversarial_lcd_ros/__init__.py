"""Measure how easily graph-based loop closure detection is fooled, over ROS 2."""

__version__ = '0.1.0'
