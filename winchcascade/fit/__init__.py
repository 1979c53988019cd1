"""Fits of the rig's model to logs: what a log says in blocks, what the model predicts of them, and what noise hides."""
