"""The ROS 2 nodes: parameters, topics and life cycle only. Nothing imports this package."""
