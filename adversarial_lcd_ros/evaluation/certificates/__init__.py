# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Certificates of a sequence: how much no few flips can turn over."""
