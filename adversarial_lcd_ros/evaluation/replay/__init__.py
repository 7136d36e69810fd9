"""Every frame of a sequence, through the nodes or without them."""
