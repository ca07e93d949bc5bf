"""What the studies share: their command line, and times."""
