"""The questions of ``mlg check`` on a terminal: one inspection, joint by joint."""

from mlg_troubleshoot.cli.prompts.answers import Answers
from mlg_troubleshoot.cli.prompts.ask import EntryInterruptedError, ask_inspection
from mlg_troubleshoot.cli.prompts.conversation import Effect
from mlg_troubleshoot.cli.prompts.lines import Line
from mlg_troubleshoot.cli.prompts.store import Session, SessionFileError, SessionStore
from mlg_troubleshoot.cli.prompts.terminal import RichTerminal
from mlg_troubleshoot.cli.prompts.visit import Visit, last_visit

__all__ = [
    "Answers",
    "Effect",
    "EntryInterruptedError",
    "Line",
    "RichTerminal",
    "Session",
    "SessionFileError",
    "SessionStore",
    "Visit",
    "ask_inspection",
    "last_visit",
]
