"""What follows from the clearances of a gear: prediction, verdict, ranking, plan, repair sets."""

__all__ = [
    "assessment",
    "case",
    "inspection",
    "judge_rows",
    "next_joint",
    "order",
    "plan",
    "prediction",
    "sentences",
]
