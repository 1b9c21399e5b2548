"""What must never leave with exit 0: drawn inspections with a truth of their own."""
