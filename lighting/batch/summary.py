"""What became of a batch's photos, in one line."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Summary:
    """Numbers of photos, and how long this run took."""

    done: int  # with a light, in all results
    failed: int
    earlier: int  # of both, by the runs before
    seconds: float
    others: Counter[str] = field(default_factory=Counter)  # pictures of kinds that are not read, by suffix

    def __str__(self) -> str:
        rate = (self.done + self.failed - self.earlier) / max(self.seconds, 1e-3)
        before = f"{self.earlier} by an earlier run, " if self.earlier else ""
        skipped = f"{self.others.total()} skipped{in_words(self.others)}"
        return f"{self.done} done, {self.failed} failed, {skipped}; {before}{rate:.1f} photos a second."


def in_words(others: Counter[str]) -> str:
    """The kinds in brackets after a space, such as "(2 .gif, 1 .jxl)", the most frequent first; nothing for none."""
    ordered = sorted(others.items(), key=lambda kind: (-kind[1], kind[0]))
    listed = ", ".join(f"{count} {suffix}" for suffix, count in ordered)
    return f" ({listed})" if listed else ""
