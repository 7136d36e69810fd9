# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files in and out: bounded readers of what may be hostile, writers of whole files."""
