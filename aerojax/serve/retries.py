"""How long to wait before what failed is tried again."""

from __future__ import annotations

from dataclasses import dataclass

from aerojax.core.config import require_at_least


@dataclass(frozen=True)
class RetryConfig:
    """Waits that double from one failure to the next, and begin anew after a success.

    first_s: after the first failure. most_s: the longest wait.
    """

    first_s: float = 0.5
    most_s: float = 30.0

    def __post_init__(self) -> None:
        require_at_least(self, "first_s", least=1e-3)
        require_at_least(self, "most_s", least=self.first_s)

    def delay_s(self, failures: int) -> float:
        """The wait after so many failures in a row, one or more."""
        doublings = min(failures - 1, 64)  # far beyond any `most_s`, and no overflow
        return min(self.first_s * 2.0**doublings, self.most_s)
