# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many attacks on sampled frames of many sequences: cells, resumable, side by side."""
