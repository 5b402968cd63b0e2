"""Things counted as people write it."""

from __future__ import annotations


def plural(count: int, thing: str) -> str:
    """Count things: ``1 frame``, ``2 frames``, ``1 posture``; a y that ends a word becomes ``ies``.

    Parameters
    ----------
    count : int
        How many.
    thing : str
        One of them; of several words the last is counted.
    """
    if count == 1:
        return f"1 {thing}"
    several = f"{thing[:-1]}ies" if thing.endswith("y") and thing[-2:-1] not in "aeiou" else f"{thing}s"
    return f"{count:,} {several}"
