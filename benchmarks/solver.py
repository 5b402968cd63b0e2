"""Time of a noisy frame, in batches and alone, with the compiled solver and the NumPy reference; time of exact frames.

    python -m benchmarks.solver [--frames 150] [--noise 2] [--one 30] [--reference 10]

Views are random valid postures of the built-in figure at 2.5 to 6 m, with a given neck. The methods run in turns, and
the least processor time of each is printed. Also prints whether a frame has the same result alone and in a batch, and
(`--many`) the peak memory of a call with few and with many frames.
"""

from __future__ import annotations

import resource
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from typing import Any

import numpy as np

import posekit
from benchmarks.common import least, parser, table
from posekit.cameras import View
from posekit.recovery import Recovery
from posekit.solver import engine
from posekit.synthesis import random_views, with_noise


@contextmanager
def reference() -> Iterator[None]:
    """Solve with the NumPy reference, as in an installation without a compiler."""
    compiled: Any = engine.compiled
    engine.compiled = None
    try:
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            yield
    finally:
        engine.compiled = compiled


def some(view: View, rows: slice) -> View:
    """Return selected frames of a view."""
    count = len(view)
    changed: dict[str, Any] = {
        one.name: value[rows]
        for one in fields(view)
        if isinstance(value := getattr(view, one.name), np.ndarray) and len(value) == count
    }
    return replace(view, **changed)


def noisy_view(frames: int, pixels: float, seed: int) -> View:
    """Return a view of random valid postures with given necks."""
    rng = np.random.default_rng(seed)
    view = random_views(frames, rng)
    given = replace(view, root=view.truth[:, 0], head_image=np.full_like(view.head_image, np.nan))
    return with_noise(given, pixels, rng) if pixels else given


def one_by_one(view: View, frames: int) -> list[Recovery]:
    return [posekit.recover(some(view, slice(k, k + 1))) for k in range(frames)]


def apart(whole: Recovery, alone: list[Recovery]) -> float:
    """Return the largest difference of joints and probabilities; infinite if numbers of postures differ."""
    worst = 0.0
    for k, other in enumerate(alone):
        own = whole.survivors.take(whole.rows(k))
        if len(own) != len(other.survivors):
            return np.inf
        for name in ("joints", "probability"):
            away = np.abs(getattr(own, name) - getattr(other.survivors, name))
            worst = max(worst, float(np.nanmax(away, initial=0.0)))
    return worst


def by_reference(view: View) -> None:
    with reference():
        posekit.recover(view)


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--frames", type=int, default=150)
    made.add_argument("--noise", type=float, default=2.0)
    made.add_argument("--one", type=int, default=30)
    made.add_argument("--reference", type=int, default=10)
    made.add_argument("--repeats", type=int, default=3)
    made.add_argument("--many", type=int, default=0, help="frames to watch the memory of")
    given = made.parse_args()
    exact, noisy = (noisy_view(given.frames, pixels, given.seed) for pixels in (0.0, given.noise))
    few, fewer = given.one, given.reference
    ways = {
        "exact, a batch": (given.frames, lambda: posekit.recover(exact)),
        "exact, one a call": (few, lambda: one_by_one(exact, few)),
        "noisy, a batch": (given.frames, lambda: posekit.recover(noisy)),
        "noisy, one a call": (few, lambda: one_by_one(noisy, few)),
        "noisy, reference": (fewer, lambda: by_reference(some(noisy, slice(fewer)))),
    }
    result = posekit.recover(noisy)
    one_by_one(noisy, 1)
    spent = least({name: way for name, (_, way) in ways.items()}, given.repeats)
    each = {name: 1000 * spent[name] / count for name, (count, _) in ways.items()}
    base = each["noisy, a batch"]
    print(
        table(("way", "ms a frame", "ratio"), [(n, f"{t:.2f}", f"{t / base:.2f}") for n, t in each.items()])
    )
    print(f"largest difference alone and among others: {apart(result, one_by_one(noisy, few)):.1e}")
    peaks = []
    for frames in (given.many // 10, given.many) if given.many else ():
        posekit.recover(noisy_view(frames, given.noise, given.seed))
        peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
    if peaks:
        print(f"peak memory of a call with a tenth of {given.many} frames and with all, MiB: {peaks}")


if __name__ == "__main__":
    main()
