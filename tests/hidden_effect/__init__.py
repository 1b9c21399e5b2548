"""Effects hidden in simulated inspections, and the requirement that they are found."""
