"""The geometry of a gear from readings of a real one."""
