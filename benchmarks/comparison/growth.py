"""How the tree's cost grows: with the views in a call, the joints, the survivors, and the noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.comparison.measure import Chart, Line, Section, Sizes, least
from benchmarks.comparison.trees import CHUNK_VIEWS, grow, on, paths, physical_checks
from posekit.body import Figure, load_figure
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE
from posekit.skeleton import JOINTS
from posekit.synthesis import SyntheticScene, random_views
from posekit.tree import Check

Way = Callable[[], list[np.ndarray]]
NOISE_PIXELS = (0.0, 1.0, 2.0, 5.0)
JOINT_COUNTS = (4, 6, 8, 10, 12, 14)
N_GROUPS = 5
"""Groups of views by their number of survivors."""


def section(sizes: Sizes) -> Section:
    """Measure all four, on each path through the tree."""
    figure = load_figure()
    checks = physical_checks(figure)
    scene = random_views(figure, sizes.views, np.random.default_rng(0))
    studies = {
        "views in a call": _frames(figure, scene, checks),
        "joints": _joints(figure, scene, checks),
        "survivors": _survivors(figure, scene, checks),
        "noise": _noise(figure, scene),
    }
    rows: list[tuple[str, ...]] = []
    charts: list[Chart] = []
    ratios: dict[str, float] = {}
    for what, study in studies.items():
        lines = []
        for path in paths():
            x, cost, counts = _measured(study, path, sizes.repeats)
            lines.append(Line(f"{path} path", x, cost))
            rows += [
                (f"{what}: {at:g}", path, f"{time:.4g}", f"{count:.0f}")
                for at, time, count in zip(x, cost, counts, strict=True)
            ]
        if len(lines) == 2:
            ratios[f"fast path against plain, {what}"] = float(
                np.exp(np.mean(np.log(np.divide(lines[0].y, lines[1].y))))
            )
        unit = {"noise": "standard deviation, px", "survivors": "survivors, median of the group"}.get(
            what, what
        )
        charts.append(
            Chart(
                name=f"growth-{what.split()[0]}",
                title=f"Cost over {what}",
                x=unit,
                y="µs a view, one core",
                lines=tuple(lines),
                log="both" if what == "views in a call" else "y",
            )
        )
    return Section(
        title="What the cost grows with",
        text=f"The same {len(scene)} views. Joints: the tree over the first ones alone, with the checks that read no "
        f"others. Survivors: the views in {N_GROUPS} groups, by how many they have. Noise: on the image points, "
        "with the tolerances for measured points, at zero noise too.",
        head=("what", "path", "µs a view", "survivors, median"),
        rows=rows,
        ratios=ratios,
        charts=tuple(charts),
    )


Study = dict[float, tuple[Way, int]]


def _measured(study: Study, path: str, repeats: int) -> tuple[list[float], list[float], list[float]]:
    """Return where, µs a view, and median survivors."""
    with on(path):
        counts = [float(np.median([len(codes) for codes in way()])) for way, _ in study.values()]
        costs = least({str(at): way for at, (way, _) in study.items()}, repeats)
    times = [costs[str(at)].cpu / count * 1e6 for at, (_, count) in study.items()]
    return list(study), times, counts


def _frames(figure: Figure, scene: SyntheticScene, checks: list[Check]) -> Study:
    some = min(len(scene), CHUNK_VIEWS)

    def ways(size: int) -> Way:
        firsts = range(0, some - size + 1, size)
        parts = [scene.select(np.arange(first, first + size)) for first in firsts]
        return lambda: [codes for part in parts for codes in grow(figure, part, checks)]

    found: Study = {}
    for size in (1, 5, 25, 50, 250):
        if size <= some:
            found[size] = ways(size), some // size * size
    return found


def _joints(figure: Figure, scene: SyntheticScene, checks: list[Check]) -> Study:
    some = scene.select(np.arange(min(len(scene), 2 * CHUNK_VIEWS)))

    def way(joints: int) -> Way:
        known = [check for check in checks if max(check.points) < joints] if joints < len(JOINTS) else checks
        return lambda: grow(figure, some, known, joints=joints)

    return {float(joints): (way(joints), len(some)) for joints in JOINT_COUNTS}


def _survivors(figure: Figure, scene: SyntheticScene, checks: list[Check]) -> Study:
    counts = np.array([len(codes) for codes in grow(figure, scene, checks)])
    found: Study = {}
    for rows in np.array_split(np.argsort(counts, kind="stable"), N_GROUPS):
        part = scene.select(rows)
        at = float(np.median(counts[rows]))
        found[at] = (lambda part=part: grow(figure, part, checks)), len(part)  # type: ignore[misc]
    return found


def _noise(figure: Figure, scene: SyntheticScene) -> Study:
    checks = physical_checks(figure, MEASURED_TOLERANCE)
    some = scene.select(np.arange(min(len(scene), CHUNK_VIEWS)))
    found: Study = {}
    for sigma in NOISE_PIXELS:
        seen = some.with_noise(sigma, np.random.default_rng(1)) if sigma else some
        found[sigma] = (
            (lambda seen=seen: grow(figure, seen, checks, tangent=MEASURED_TOLERANCE.tangent)),  # type: ignore[misc]
            len(some),
        )
    return found


__all__ = ["EXACT_TOLERANCE", "section"]
