"""The command line, end to end: what goes in, what comes out, and the exit code."""
