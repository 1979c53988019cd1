"""Why model and measurement differ: fit, gap, causes, closure and the next test run."""
