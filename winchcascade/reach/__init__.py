"""What a rig can reach: a published table held against its constants, and the effects that could move it."""
