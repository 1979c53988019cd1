"""`python -m winchcascade` is the command line."""

from winchcascade.cli import main

main()
