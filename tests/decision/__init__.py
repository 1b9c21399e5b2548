"""The decision: verdict, uncertainty, ranking, next action, repair sets."""
