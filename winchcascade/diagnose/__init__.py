"""Which unmodelled effects explain a gap, how far they close it, and what would tell them apart."""
