# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closures -> map: odometry that drifts, a pose graph, back ends, and how far off they end."""
