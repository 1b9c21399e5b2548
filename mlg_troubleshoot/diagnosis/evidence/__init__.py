"""What both diagnoses stand on: evidence beyond chance, several causes one by one, rows that are held out."""
