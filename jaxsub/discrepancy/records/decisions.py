"""Records of what a diagnosis decided: which candidate, by which test, at which threshold, and what followed."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any


@dataclasses.dataclass(frozen=True)
class Decision:
    """One choice: the `test` of a `candidate` gave a `statistic`, whose `threshold` decided the `outcome`.

    `candidate` is the label of an effect, or of several joined by commas, and "mismatch" where none is meant.
    """

    candidate: str
    test: str
    statistic: float
    threshold: float
    outcome: str

    def to_json(self) -> dict[str, Any]:
        """As it stands in `diagnosis.json`; null for a statistic that is no number, as of a model that diverges."""
        record = dataclasses.asdict(self)
        return record | {"statistic": self.statistic if math.isfinite(self.statistic) else None}


def decision_rows(decisions: Sequence[Decision]) -> list[tuple[str, str, str, str, str]]:
    """The same as a table's rows of text."""
    return [(d.candidate, d.test, f"{d.statistic:.4g}", f"{d.threshold:.4g}", d.outcome) for d in decisions]
