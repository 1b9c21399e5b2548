"""The questions of ``mlg check`` on a terminal: one inspection, joint by joint."""

from mlg_troubleshoot.cli.prompts.answers import Answers
from mlg_troubleshoot.cli.prompts.ask import EntryInterruptedError, ask_inspection
from mlg_troubleshoot.cli.prompts.lines import Line
from mlg_troubleshoot.cli.prompts.store import Session, SessionFileError, SessionStore
from mlg_troubleshoot.cli.prompts.terminal import RichTerminal

__all__ = [
    "Answers",
    "EntryInterruptedError",
    "Line",
    "RichTerminal",
    "Session",
    "SessionFileError",
    "SessionStore",
    "ask_inspection",
]
