"""What each kind of result states: one module for each, from the result to a `content.Report`."""
