"""Share of planted defects that the right check finds in the right frames.

    python -m benchmarks.defects [--data DIR] [--clips 25] [--seed 0] [--only KIND,KIND] [--half 1] [--missed]

The benchmark plants each kind of defect into a span of each clip. A defect counts as found if the first and the last
frame that the right check rejects are at most three frames from the ends of the span. Sliding, floating and sinking
feet are planted into spans in which a foot is at rest. `--half 0` uses the clips with even numbers, `--half 1` the
clips with odd numbers. `--missed` lists the defects that are not found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import data_of, parser, recordings, table
from posekit.geometry import Array
from posekit.motion import Motion
from posekit.settings import ValidateSettings
from posekit.skeleton import FEET_POINTS, HEAD_POINTS, JOINTS, LIMB_JOINTS, other_side
from posekit.validators import Report, validate_motion
from posekit.validators.body import Body
from posekit.validators.motion.ground import ground_of

NAMES = (*JOINTS, *HEAD_POINTS, *FEET_POINTS)
SPAN_TOLERANCE = 3
Span = tuple[int, int]


@dataclass(frozen=True)
class Kind:
    """A kind of defect.

    `checks` are the right checks, or `warning` a word of the right warning. `plant` returns points with the defect,
    given points, span, up, seconds per frame and a generator. `frames` bounds the length of the span at 30 Hz.
    """

    checks: tuple[str, ...]
    plant: Callable[..., Any]
    frames: tuple[int, int] = (15, 60)
    warning: str = ""
    grounded: bool = False


def inside(count: int, span: Span) -> Array:
    """Return 1 in a span and 0 outside."""
    found = np.zeros(count)
    found[span[0] : span[1] + 1] = 1.0
    return found


def level(up: Array, rng: np.random.Generator) -> Array:
    drawn = rng.normal(size=3)
    drawn -= (drawn @ up) * up
    return drawn / np.linalg.norm(drawn)


def lifted(size: float) -> Callable[..., Any]:
    return lambda points, span, up, step, rng: points + size * inside(len(points), span)[:, None, None] * up


def slide(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
    way = 0.1 * step * np.cumsum(inside(len(points), span))
    return points + way[:, None, None] * level(up, rng)


def ramp(size: float) -> Callable[..., Any]:
    def plant(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
        way = np.cumsum(inside(len(points), span))
        return np.asarray(points + size * (way / way[-1])[:, None, None] * up)

    return plant


def jump(whole: bool) -> Callable[..., Any]:
    def plant(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
        moved, by = points.copy(), rng.normal(size=3)
        which = slice(None) if whole else int(rng.integers(len(JOINTS)))
        moved[span[0], which] += 0.15 * by / np.linalg.norm(by)
        return moved

    return plant


def swap(*parts: str) -> Callable[..., Any]:
    order = [NAMES.index(other_side(n)) if any(p in n for p in parts) else k for k, n in enumerate(NAMES)]

    def plant(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
        moved, rows = points.copy(), slice(span[0], span[1] + 1)
        moved[rows] = points[rows][:, order]
        return moved

    return plant


def bent(middle: str, flexion: float) -> Callable[..., Any]:
    def plant(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
        side = ("right_", "left_")[int(rng.integers(2))]
        start, bend, end = next(limb for limb in LIMB_JOINTS if JOINTS[limb[1]] == side + middle)
        rows, moved = slice(span[0], span[1] + 1), points.copy()
        upper, lower = moved[rows, bend] - moved[rows, start], moved[rows, end] - moved[rows, bend]
        along = upper / np.linalg.norm(upper, axis=-1, keepdims=True)
        length = np.linalg.norm(lower, axis=-1, keepdims=True)
        across = lower - (lower * along).sum(-1, keepdims=True) * along
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
        angle = np.radians(flexion)
        moved[rows, end] = moved[rows, bend] + length * (np.cos(angle) * along + np.sin(angle) * across)
        return moved

    return plant


def drift(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Any:
    limb = LIMB_JOINTS[int(rng.integers(4))]
    first = int(rng.integers(2))
    start, end = limb[first], limb[first + 1]
    weight = np.convolve(inside(len(points), (span[0] - 2, span[1] + 2)), np.full(5, 0.2), mode="same")
    way = (points[:, end] - points[:, start]) * (rng.choice((-1.0, 1.0)) * 0.05 * weight)[:, None]
    moved = points.copy()
    for joint in limb[first + 1 :]:
        moved[:, joint] += way
    rows = np.flatnonzero(weight > 0.5)
    return moved, (int(rows[0]), int(rows[-1]))


def jitter(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
    return points + inside(len(points), span)[:, None, None] * rng.normal(0, 0.015, points.shape)


def frozen(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
    order = np.arange(len(points))
    order[span[0] : span[1] + 1] = span[0] - 1
    return points[order]


def shuffled(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Any:
    steps = np.linalg.norm(np.diff(points[span[0] : span[1] + 1, : len(JOINTS)], axis=0), axis=-1).max(axis=1)
    if np.median(steps) < 0.02:
        return None
    order, rows = np.arange(len(points)), np.arange(span[0], span[1] + 1)
    drawn = rng.permutation(rows)
    while drawn[0] == rows[0] or drawn[-1] == rows[-1]:
        drawn = rng.permutation(rows)
    order[rows] = drawn
    return points[order]


def turned(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Array:
    axis = np.eye(3)[np.abs(up) < 0.5][int(rng.integers(2))]
    angle = np.radians(rng.choice((90.0, -90.0, 180.0)))
    K = np.cross(np.eye(3), axis)
    return np.asarray(points @ (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K))


def t_pose(points: Array, span: Span, up: Array, step: float, rng: np.random.Generator) -> Any:
    first = points[0].copy()
    axis = level(up, rng)
    flip = 2 * np.outer(up, up) - np.eye(3)  # half a turn about up
    first = (first - first[3]) @ flip.T + first[3] + 0.5 * axis
    return np.concatenate([first[None], points[1:]]), (0, 0)


#: Kinds by name. Slow floating and sinking are judged relative to the ground of the clean clip.
KINDS = {
    "floating 5 cm": Kind(("floating", "support"), lifted(0.05), grounded=True),
    "sinking 5 cm": Kind(("penetration",), lifted(-0.05), grounded=True),
    "slow floating 15 cm": Kind(("floating",), ramp(0.15), (60, 90)),
    "slow sinking 15 cm": Kind(("penetration",), ramp(-0.15), (60, 90)),
    "slide 10 cm/s": Kind(("sliding",), slide, (45, 45), grounded=True),
    "jump of a joint": Kind(("teleport",), jump(False), (1, 1)),
    "jump of the body": Kind(("teleport",), jump(True), (1, 1)),
    "swap": Kind(
        ("swap",), swap("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe", "heel"), (10, 60)
    ),
    "swap of legs": Kind(("swap",), swap("hip", "knee", "ankle", "toe", "heel"), (10, 60)),
    "elbow -15": Kind(("joint-range",), bent("elbow", -15.0)),
    "knee -20": Kind(("joint-range",), bent("knee", -20.0)),
    "drift 5 %": Kind(("drift",), drift),
    "jitter": Kind(("jitter",), jitter),
    "frozen": Kind(("frozen",), frozen, (12, 30)),
    "shuffled": Kind(("timing",), shuffled),
    "wrong axis": Kind(("orientation",), turned, (0, 0)),
    "T-pose first": Kind(("teleport",), t_pose, (0, 0)),
    "rate": Kind(("rate",), lambda points, *rest: points, (0, 0), "rate"),
}


def named(report: Report, kind: Kind) -> Span | None:
    """Return the first and the last frame that the right checks reject; None if they reject no frame."""
    which = [k for k, name in enumerate(report.checks) if name in kind.checks]
    rows = report.findings["row"][np.isin(report.findings["check"], which)]
    return (int(rows.min()), int(rows.max())) if len(rows) else None


def standing(motion: Motion, points: Array, up: Array) -> NDArray[np.bool_]:
    """Return whether a toe (or an ankle, if toes are unknown) rests in each frame: near the ground, below 0.1 m/s."""
    toes = [NAMES.index(f"{side}_toe") for side in ("right", "left")]
    feet = points[:, toes]
    if np.isnan(feet).all():
        feet = points[:, [NAMES.index(f"{side}_ankle") for side in ("right", "left")]]
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * (motion.rate or 30.0)
    height = feet @ up
    return np.asarray(((speed < 0.1) & (height < np.nanpercentile(height, 5) + 0.03)).any(axis=1))


def spans_of(kind: Kind, stands: NDArray[np.bool_], rate: float, rng: np.random.Generator) -> Span | None:
    """Return a random span for the kind, eight frames or more from the ends; None if no span fits."""
    count = len(stands)
    least, most = (max(1, round(one * rate / 30)) if one > 1 else one for one in kind.frames)
    if not most:
        return 0, count - 1
    if least > count - 16:
        return None
    length = int(rng.integers(least, min(most, count - 16) + 1))
    firsts = np.arange(8, count - 8 - length + 1)
    if kind.grounded:
        share = np.convolve(stands, np.ones(length), mode="valid") / length
        firsts = firsts[share[firsts] == 1.0]
    if not len(firsts):
        return None
    first = int(rng.choice(firsts))
    return first, first + length - 1


def try_kind(name: str, motion: Motion, rng: np.random.Generator) -> tuple[bool, str] | None:
    """Plant one defect; return whether it is found, and the findings. Return None if it does not fit the clip."""
    kind, points, up = KINDS[name], motion.points(NAMES), motion.up_vector
    assert up is not None  # clips without an up axis are left out
    rate, count = motion.rate or 30.0, len(motion)
    span = spans_of(kind, standing(motion, points, up), rate, rng)
    if span is None:
        return None
    length = span[1] - span[0] + 1
    clean_ground = ground_of(Body.of(motion, ValidateSettings())).low if "slow" in name else None
    planted = kind.plant(points, span, up, 1.0 / rate, rng)
    if planted is None:
        return None
    if isinstance(planted, tuple):
        planted, span = planted
    time = np.asarray(motion.time)
    if kind.warning:
        time = time * rng.choice((0.5, 2.0))
    broken = replace(motion, joints=planted, joint_names=NAMES, time=time, document=None)
    report = validate_motion(broken, ValidateSettings(ground=clean_ground))
    said = {one: row["frames"] for one, row in report.by_check().items() if row["frames"]}
    if kind.warning:
        return any(kind.warning in one for one in report.warnings), f"{said}"
    found = named(report, kind)
    told = f"planted {span}, named {found}, all {said}"
    if found is None:
        return False, told
    if "slow" in name:  # findings start where the height exceeds its bound, and last to the end
        return found[1] >= count - 1 - SPAN_TOLERANCE and abs(found[0] - span[0]) < 0.6 * length, told
    return all(abs(a - b) <= SPAN_TOLERANCE for a, b in zip(found, span, strict=True)), told


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--clips", type=int, default=25)
    made.add_argument("--only", default="")
    made.add_argument("--half", type=int)
    made.add_argument("--missed", action="store_true")
    given = made.parse_args()
    clips = recordings(data_of(given))[slice(given.half, None, 1 if given.half is None else 2)]
    rng, rows = np.random.default_rng(given.seed), []
    reports = [validate_motion(one) for one in clips]
    for name in given.only.split(",") if given.only else KINDS:
        usable = [k for k, one in enumerate(reports) if named(one, KINDS[name]) is None]
        hits: list[bool] = []
        others: Counter[str] = Counter()
        for k in rng.permutation(usable).tolist() * 3:
            found = try_kind(name, clips[k], rng) if len(hits) < given.clips else None
            if found is not None:
                hits.append(found[0])
                others[clips[k].source] += not found[0]
                if given.missed and not found[0]:
                    print(f"missed: {name}, {clips[k].source}: {found[1]}", flush=True)
        rows.append((name, len(hits), sum(hits), len(set(+others))))
    print(f"{len(clips)} clips")
    print(table(("defect", "planted", "found", "clips with a miss"), rows))


if __name__ == "__main__":
    main()
