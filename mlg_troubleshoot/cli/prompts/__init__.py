"""The questions of ``mlg check`` on a terminal: one sitting at one gear."""
