"""The command line: each command parses its options, calls one function and prints the result."""

from winchcascade.cli.entry import run as main

__all__ = ["main"]
