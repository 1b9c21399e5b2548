"""The questions of ``mlg check`` on a terminal: one sitting at one gear."""

from mlg_troubleshoot.cli.prompts.ask import Asker, EntryInterruptedError
from mlg_troubleshoot.cli.prompts.entry import Entry
from mlg_troubleshoot.cli.prompts.visit import (
    SavedEntries,
    Terminal,
    Visit,
    continued,
    find_visit,
    reading_order,
)

__all__ = [
    "Asker",
    "Entry",
    "EntryInterruptedError",
    "SavedEntries",
    "Terminal",
    "Visit",
    "continued",
    "find_visit",
    "reading_order",
]
