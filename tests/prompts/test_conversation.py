"""The words that every conversation knows, and what it shows again."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.cli.prompts.conversation import Conversation, Effect, Turn, answer
from mlg_troubleshoot.cli.prompts.flow import Flow
from tests.prompts.scripted import RADIAL_INCHES, ScriptedTerminal


@pytest.mark.parametrize("typed", ["q", "quit", "QUIT"])
def test_a_conversation_stops_at_either_word(flow: Flow, typed: str) -> None:
    assert answer(flow, flow.begin(RADIAL_INCHES).state, typed).effect is Effect.STOP


def test_a_question_that_is_asked_again_is_not_shown_again(flow: Flow) -> None:
    terminal = ScriptedTerminal(["thick", "thin"])
    conversation = Conversation(flow, terminal)
    state = flow.begin(RADIAL_INCHES).state
    conversation.next(Turn(state))
    shown = terminal.screen.count("joint 1 of 10")
    conversation.next(Turn(state))
    assert (shown, terminal.screen.count("joint 1 of 10")) == (1, 1)
