"""The rig as a diagnosis leaves it, for rig files, other programs and designs."""
