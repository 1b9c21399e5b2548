"""The gear: its file, its linkages, clearances as virtual links, worst directions."""
