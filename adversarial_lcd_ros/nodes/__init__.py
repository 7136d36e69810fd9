# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes: parameters, topics and life cycle only. Nothing imports this package."""
