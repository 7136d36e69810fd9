# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bare relay: what the man in the middle costs is measured beside it."""

import sys

from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros.nodes.endpoints import create_payload_publisher, payload_qos
from adversarial_lcd_ros.nodes.runtime import Manual, PipelineNode, run_node


class RelayNode(PipelineNode):
    """Publishes the bytes that come in."""

    default_name = 'relay'
    configs = ()
    manual = Manual('bytes in, bytes out', ('graph_clean',), ('graph',))

    def __init__(self, **options):
        super().__init__(**options)
        output = create_payload_publisher(self, 'graph')
        self._input = self.create_subscription(
            UInt8MultiArray, 'graph_clean', output.publish, payload_qos(), raw=True)


if __name__ == '__main__':
    sys.exit(run_node(RelayNode))
