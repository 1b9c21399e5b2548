"""One file for each task of a user: options in, result out. No terminal here."""
