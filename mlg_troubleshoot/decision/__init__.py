"""What follows from the clearances of a gear: prediction, verdict, ranking, plan, repair sets."""

__all__ = [
    "assessment",
    "columns",
    "inspection",
    "judge_rows",
    "learning",
    "prediction",
    "sentences",
]
