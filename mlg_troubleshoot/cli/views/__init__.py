"""What a terminal shows: one gear, a batch, notes and problems."""
