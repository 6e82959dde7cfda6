"""What became of a log that was made another format."""

from __future__ import annotations

from dataclasses import dataclass

#: sentences of a kind that are kept
_MOST_SAID = 5


@dataclass(frozen=True)
class Converted:
    """What a log's numbers were made: `losses` make status 3, `start` as ISO 8601 if it tells."""

    losses: tuple[str, ...] = ()
    passed_over: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    start: str | None = None

    @property
    def said(self) -> list[str]:
        """The remarks, and one on what was passed over, if anything was."""
        some = "; ".join(self.passed_over[:3]) + ("; ..." if len(self.passed_over) > 3 else "")
        return [*self.remarks[:_MOST_SAID], *([f"not read: {some}"] if some else [])]
