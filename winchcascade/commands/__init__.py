"""The commands: each reads, calls one function and shows."""
