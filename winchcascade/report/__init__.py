"""Results laid out for reading: terminal, JSON, Parquet."""
