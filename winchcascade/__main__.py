"""`python -m winchcascade` is the command line."""

from winchcascade.cli.entry import run

run()
