"""What follows from the clearances of a gear: prediction, verdict, ranking, plan, repair sets."""

__all__ = [
    "assessment",
    "case",
    "columns",
    "inspection",
    "judge_rows",
    "next_joint",
    "plan",
    "prediction",
    "ranking",
    "sentences",
]
