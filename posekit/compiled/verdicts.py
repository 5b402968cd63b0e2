"""What a screen says of a posture besides the place that it violates."""

from __future__ import annotations

NO_VIOLATION = -1
"""Of a screen: no place is violated."""

NOT_CLEAR = -2
"""Of a screen: only the judge can tell."""
