"""Conversion of named points to a motion, with checks of missing values, layout, unit, up axis and times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from posekit.errors import InputError, refusal, shown
from posekit.formats.layout import LIMBS, Layout, by_names, by_order, load_layout, plain
from posekit.formats.options import Options
from posekit.geometry import FARTHEST_COORDINATE, UP_AXES, Array, Flags, Ints, up_vector
from posekit.motion import Motion
from posekit.skeleton import JOINT, JOINTS, LIMB_SHARES, SIDES

#: Metres in each unit of length that a user or a file can state.
METRES: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}

#: Range of statures of most recorded people: a body that is 67 units tall is in inches, not a toddler of 67 cm.
USUAL_METRES: Final = (1.2, 2.2)
#: Smallest stature (toddler, small robot) and largest stature (giant) by which a unit is recognised.
BODY_METRES: Final = (0.4, 2.5)
#: Smallest and largest stature that is still read as metres, because other units fit a person even less.
POSSIBLE_METRES: Final = (0.2, 5.0)

#: Minimum cosine between the mean direction from ankles to shoulders and the axis along which a body stands.
CLEAR_UP_SHARE: Final = 0.7
#: Bounds of the lowest joint's range along an axis. Below the first bound the axis may be vertical (an ankle rises as
#: much in a step). Above the second it is not (the range is larger than from a crouch to tiptoe).
FLAT_METRES, STEEP_METRES = 0.15, 0.6
#: Minimum ratio of the height range along another axis to the range along the up axis of a level ground.
CLEAR_RATIO: Final = 2.0
#: Points that are rigidly fixed to a point: tolerance added to the range of their distance, and largest sum of both, as
#: shares of the usual distance (distances in a torso vary by 7 %, along limbs by more); number of points needed.
RIGID_SHARE, RIGID_MOST, RIGID_NEIGHBOURS = 0.05, 0.2, 3
#: Relative difference between a stated rate and the rate of the time stamps, above which they contradict each other.
RATE_DISAGREES: Final = 0.1
#: Distance from the origin below which a root is at the origin: float32 and rounding leave 0.1 mm.
ROUNDING_METRES: Final = 1e-4
#: Smallest rounding error of time stamps that is reported in a note, seconds.
NOTED_SECONDS: Final = 1e-4
#: Largest relative difference between the lengths of right and left limbs if the order of points is correct.
SIDES_SHARE: Final = 0.25
#: Largest distance of a midpoint from the mean of its two joints, as a share of the leg, if the order is correct.
MIDDLE_SHARE: Final = 0.25


def points_motion(
    points: Array,
    names: Sequence[str],
    source: str,
    options: Options,
    *,
    layout: Layout | None = None,
    time: Array | None = None,
    rate: float | None = None,
    unit: str = "",
    metres: float | None = None,
    up: str = "",
    up_by_custom: str = "",
    partial: bool = False,
    **fields: Any,
) -> Motion:
    """Convert 3D points of a file to a motion.

    Parameters
    ----------
    points : array (T, P, 3)
        Positions in the file's unit.
    names : sequence of str (P,)
        Names of the points in the file; empty for points without names.
    source : str
        Path of the file.
    options : Options
        Facts stated by the user, which override the file's; notes and warnings are added to it.
    layout : Layout, optional
        Layout of the names, if the reader knows it.
    time : array (T,), optional
        Time stamps of the file, seconds; they take precedence over rates.
    rate : float, optional
        Frames per second, as stated by the file.
    unit, up : str
        Unit and up axis, as stated by the file; empty if it does not state them.
    metres : float, optional
        Metres per unit of the file, if the reader knows it.
    up_by_custom : str
        Axis that points up by the format's convention.
    partial : bool
        Whether points that fit no layout are accepted as markers. The motion then has no joints, but a warning.
    **fields
        Further fields of `Motion`.

    Raises
    ------
    InputError
        If no layout fits, or a stated fact is wrong.
    """
    points = np.array(points, dtype=np.float64)
    if points.ndim != 3 or points.shape[2] != 3 or not len(points):
        raise refusal(source, "points", f"shape {points.shape}", "frames x points x 3", "check the file")
    layout = _layout_of(points, names, source, options, layout, partial)
    if not names:
        points, names = points[:, : len(layout.points)], layout.points
    _mark_missing(points, names, layout, options)
    placed, joints, derived = layout.place(names, points)
    if layout.name and not set(placed) & set(JOINTS):
        expected = f"some of {', '.join(part for parts in layout.sources.values() for part in parts)[:200]}"
        raise refusal(source, "points", f"no point of {layout.name}", expected, "choose another layout")
    if derived:
        options.note(f"{' and '.join(derived)} placed from shoulders and hips")
    missing = ", ".join(limb for limb in LIMBS if limb not in placed)
    if missing and layout.name:
        options.warn(f"{missing} are not in the file: checks that need them are undecided")
    body = _tree(placed, joints)
    _check_depth(_tree(placed, joints, without=derived), source)
    unit = options.unit or unit or layout.fields.get("unit", "")
    if metres is None:
        unit, metres = body_unit(body, unit, options)
    joints, body = joints * metres, body * metres
    clip, frame = fields.get("clip"), fields.get("frame")
    stated = options.up or up or layout.fields.get("up", "")
    up = body_up(body, clip, stated, up_by_custom, options)
    time = times(len(points), time, rate, options, clip, frame)
    fields.setdefault("in_world", not _is_rooted(body))
    if not fields["in_world"]:
        options.note("every frame is relative to its own hips: ground and travel are unknown")
    fields |= {"source": source, "layout": layout.name, "notes": options.notes, "warnings": options.warnings}
    return Motion(joints=joints, joint_names=placed, time=time, up=up, unit=unit, **fields)


def _layout_of(
    points: Array, names: Sequence[str], source: str, options: Options, layout: Layout | None, partial: bool
) -> Layout:
    """Return the stated layout, or a layout that fits the names or the points; an empty layout if markers fit none."""
    if options.layout:
        layout = load_layout(options.layout)
        if layout.kind != "points":
            raise refusal(source, "layout", shown(layout.name), "a layout of points", "choose another layout")
    if layout is None and not names:
        layout = unnamed(points, source, options)
    if layout is None:
        try:
            return by_names(names, source)
        except InputError as error:
            if not partial:
                raise
            why = str(error).partition("got ")[2]
            options.warn(f"no joints among {len(names)} markers: {why}")
            return Layout(name="", points=tuple(names))
    if not names and not 0 < len(layout.points) <= points.shape[1]:
        got = f"{points.shape[1]} points without names"
        expected = f"the {len(layout.points)} of {layout.name}" if layout.points else "names of the points"
        raise refusal(source, "points", got, expected, "choose another layout")
    return layout


def unnamed(points: Array, source: str, options: Options) -> Layout:
    """Find the layout of points (T, P, 3) without names, by their number and the shape of a body.

    Raises
    ------
    InputError
        If no layout has P points, or several layouts have P points and none of them gives a human body.
    """
    candidates = by_order(points.shape[1])
    fits = [one for one in candidates if _misfit(one, points) < 1.0]
    if len(candidates) == 1 and not fits:
        options.note(f"points are in the order of {candidates[0].name}, which has {points.shape[1]} points")
        return candidates[0]
    if not fits:
        counts = sorted({(len(one.points), one.name) for k in range(1, 200) for one in by_order(k)})
        known = ", ".join(f"{name} ({count})" for count, name in counts)
        named = ", ".join(one.name for one in candidates)
        why = ", which form a body in none of the layouts of this size" if candidates else ""
        got = f"{points.shape[1]} points without names{why}"
        remedy = f"name their order with --layout {named or 'NAME'}, or a TOML file of your own"
        raise refusal(source, "points", got, named or f"as many as {known}", remedy)
    layout = min(fits, key=lambda one: _misfit(one, points))
    options.note(f"points are in the order of {layout.name}: in this order they form a body")
    return layout


def _misfit(layout: Layout, points: Array) -> float:
    """Return the largest error of a layout (unequal limbs, misplaced midpoints), divided by the error's bound."""
    found = layout.gather(points[:, : len(layout.points)])
    if not set(LIMBS) <= set(found):
        return np.inf
    worst: list[float] = []
    leg = 0.0
    for start, end in LIMB_SHARES:
        right, left = (_apart(found[f"{side}_{start}"], found[f"{side}_{end}"]) for side in SIDES)
        if not min(right, left) > 0:
            return np.inf
        lengths = np.linalg.norm(found[f"left_{end}"] - found[f"left_{start}"], axis=-1)
        low, high = np.nanpercentile(lengths, (25, 75))
        worst += [abs(right - left) / max(right, left) / SIDES_SHARE, (high - low) / left / SIDES_SHARE]
        leg += left if start in ("hip", "knee") else 0.0
    middles = {"mid_hips": "hip", "pelvis": "hip", "mid_shoulders": "shoulder", "neck": "shoulder"}
    for name in set(middles) & set(found):
        middle = (found[f"right_{middles[name]}"] + found[f"left_{middles[name]}"]) / 2
        worst.append(_apart(found[name], middle) / leg / MIDDLE_SHARE)
    return float(max(worst))


def _apart(a: Array, b: Array) -> float:
    distance = np.linalg.norm(a - b, axis=-1)
    distance = distance[np.isfinite(distance)]
    return float(np.median(distance)) if len(distance) else float("nan")


def _mark_missing(points: Array, names: Sequence[str], layout: Layout, options: Options) -> None:
    """Set points (T, P, 3) to NaN if the file writes a constant in place of a missing point.

    A point is missing in frames in which its three coordinates equal one number, such as 0, -1 or 999, if they vary in
    other frames. A point with its usual distances from the rest of the trunk is not missing, such as a pelvis at the
    origin. A point that is zero in all frames is missing, unless it is the pelvis or the midpoint of the hips.
    """
    points[~(np.abs(points) <= FARTHEST_COORDINATE).all(axis=-1)] = np.nan
    alike = (points[..., 0] == points[..., 1]) & (points[..., 1] == points[..., 2])
    roots = {plain(part) for ours in ("pelvis", "mid_hips") for part in layout.landmarks.get(ours, ())}
    roots |= {"root", "hips", "pelvis", "hip"}
    for k in np.flatnonzero(alike.any(axis=0)).tolist():
        known = np.isfinite(points[:, k, 0])
        always = alike[known, k].all()
        if always and (len(points) == 1 or points[:, k].any() or plain(names[k]) in roots):
            continue  # one posture, a point with equal coordinates in every frame, or a root
        values, counts = np.unique(points[alike[:, k], k, 0], return_counts=True)
        sentinels = values[(values == 0) | (counts > 1)]
        gone = alike[:, k] & np.isin(points[:, k, 0], sentinels)
        gone &= always or ~_hangs_together(points, k, alike)
        if gone.any():
            points[gone, k] = np.nan
            written = ", ".join(f"{value:g}" for value in sentinels)
            options.note(f"{names[k]} is missing in {gone.sum()} of {len(points)} frames, marked {written}")


def _hangs_together(points: Array, k: int, unsure: Flags) -> Flags:
    """Return for each frame (T,) whether a point has its usual distances from points that are rigidly fixed to it.

    Parameters
    ----------
    points : array (T, P, 3)
    k : int
        Index of the point. A point of a limb has too few rigidly fixed points: the result is False in every frame.
    unsure : bool array (T, P)
        Whether a point may be missing in a frame. Distances from such points are ignored; the usual distances are
        those in frames in which point k is certainly known.
    """
    others = np.arange(points.shape[1]) != k
    apart = np.where(unsure, np.nan, np.linalg.norm(points - points[:, k, None], axis=-1))[:, others]
    elsewhere = apart[~unsure[:, k]]
    apart = apart[:, np.isfinite(elsewhere).any(axis=0)]
    elsewhere = elsewhere[:, np.isfinite(elsewhere).any(axis=0)]
    usual = np.nanmedian(elsewhere, axis=0)
    slack = np.nanmax(elsewhere, axis=0) - np.nanmin(elsewhere, axis=0) + RIGID_SHARE * usual
    rigid = np.argsort(slack / np.maximum(usual, 1e-12))[:RIGID_NEIGHBOURS]
    if len(rigid) < RIGID_NEIGHBOURS or (slack > RIGID_MOST * usual)[rigid].any():
        return np.zeros(len(points), dtype=np.bool_)
    off = (np.abs(apart - usual) - slack)[:, rigid]
    return np.asarray(np.isfinite(off).any(axis=1) & ~(off > 0).any(axis=1))


def _tree(names: Sequence[str], points: Array, without: Sequence[str] = ()) -> Array:
    """Return the 14 joints (T, 14, 3) in the order of `JOINTS`; NaN for names that are absent or excluded."""
    body = np.full((len(points), len(JOINTS), 3), np.nan)
    for k, name in enumerate(names):
        if name in JOINT and name not in without:
            body[:, JOINT[name]] = points[:, k]
    return body


def _check_depth(body: Array, source: str) -> None:
    """Refuse points whose x, y or z is the same number for all joints in all frames: such points are not 3D."""
    known = body[np.isfinite(body).all(axis=-1)]
    if len(body) > 1 and len(known) > len(body) * 4:
        for k in range(3):
            if np.ptp(known[:, k]) == 0:
                got = f"{known[0, k]:g} for every joint in every frame"
                remedy = "these are points in a picture: give the array to posekit.recover"
                raise refusal(source, f"{'xyz'[k]} coordinate", got, "three coordinates that vary", remedy)


def stature(body: Array) -> float:
    """Estimate the stature of a body with joints (T, 14, 3), in the joints' unit, from median lengths of limbs.

    The stature is NaN without limbs.
    """
    statures = [
        _apart(body[:, JOINT[f"{side}_{start}"]], body[:, JOINT[f"{side}_{end}"]]) / share
        for (start, end), share in LIMB_SHARES.items()
        for side in SIDES
    ]
    return float(np.nanmedian(statures)) if np.isfinite(statures).any() else float("nan")


def body_unit(body: Array, stated: str, options: Options) -> tuple[str, float]:
    """Find the unit of joints (T, 14, 3): the stated unit, or another unit if only that makes the body human-sized.

    Returns
    -------
    unit : str
        Name of the unit.
    metres : float
        Metres per unit.
    """
    if stated and stated not in METRES:
        raise refusal("", "unit", shown(stated), f"one of {', '.join(METRES)}", "give it with --unit")
    size = stature(body)
    metres = METRES[stated or "m"]
    if not size > 0 or POSSIBLE_METRES[0] <= size * metres <= POSSIBLE_METRES[1]:
        return stated or "m", metres
    usual, fitting = (
        [name for name, scale in METRES.items() if low <= size * scale <= high]
        for low, high in (USUAL_METRES, BODY_METRES)
    )
    fitting = usual if len(usual) == 1 else fitting
    if len(fitting) == 1:
        found = fitting[0]
        finding = f"lengths are in {found}: a body is {size * METRES[found]:.2f} m tall by its limbs"
        if stated:
            options.warn(f"{finding}; in {stated}, as stated, it would be {size * metres:.3g} m")
        else:
            options.note(finding)
        return found, METRES[found]
    basis = f"in {stated}, as stated" if stated else "in metres"
    options.warn(f"a body is {size * metres:.3g} m tall by its limbs {basis}: check the unit (--unit)")
    return stated or "m", metres


def stands_along(body: Array) -> str:
    """Return the axis along which shoulders lie above ankles (or hips) on average; empty if no axis is clear."""
    shoulders = body[:, [JOINT["right_shoulder"], JOINT["left_shoulder"]]].mean(axis=1)
    ankles = body[:, [JOINT["right_ankle"], JOINT["left_ankle"]]].mean(axis=1)
    hips = body[:, [JOINT["right_hip"], JOINT["left_hip"]]].mean(axis=1)
    way = shoulders - ankles
    way = np.where(np.isfinite(way), way, 2 * (shoulders - hips))
    length = np.linalg.norm(way, axis=1)
    known = length > 0
    if not known.any():
        return ""
    mean = (way[known] / length[known, None]).mean(axis=0)
    axis = int(np.argmax(np.abs(mean)))
    return f"{'+' if mean[axis] > 0 else '-'}{'xyz'[axis]}" if abs(mean[axis]) >= CLEAR_UP_SHARE else ""


def body_up(body: Array, clip: Ints | None, stated: str, custom: str, options: Options) -> str:
    """Find the up axis of joints (T, 14, 3): the stated axis, else by standing bodies, level ground or convention.

    If bodies contradict a stated axis, it is kept with a warning. An axis that differs from the convention gives a
    warning, too.
    """
    if stated and stated not in UP_AXES:
        raise refusal("", "up", shown(stated), f"one of {', '.join(UP_AXES)}", "give it with --up")
    stands = stands_along(body)
    rise = {name: _rise(body, clip, name) for name in UP_AXES}
    if stated:
        level = bool(stands) and rise[stated] < FLAT_METRES and rise[stands] > STEEP_METRES
        if stands and stands != stated and not level:
            how = "upside down" if stands[1] == stated[1] else "lying"
            options.warn(
                f"the person is {how} in most frames if {stated} is up, as stated: bodies stand along {stands} (--up)"
            )
        return stated
    if stands and not (rise[stands] > STEEP_METRES and min(rise.values()) < FLAT_METRES):
        finding = f"{stands} is up, because bodies stand along it"
        if custom and stands != custom:
            options.warn(f"{finding}, against {custom} by convention: if people lie, state the axis (--up)")
        elif stands[0] == "-":
            options.warn(f"{finding}: the head is below the feet along +{stands[1]}")
        elif stands != custom:
            options.note(finding)
        return stands
    best = min(UP_AXES, key=lambda name: rise[name])
    others = min(rise[name] for name in UP_AXES if name[1] != best[1])
    if rise[best] < FLAT_METRES and CLEAR_RATIO * rise[best] < others:
        best = custom if custom[1:] == best[1] else f"+{best[1]}"
        options.note(f"{best} is up by the ground: the height of the lowest joint along it hardly varies")
        return best
    if not custom:
        options.note("the up axis is unknown: no body stands upright, no ground is level (--up)")
    return custom


def _rise(body: Array, clip: Ints | None, up: str) -> float:
    """Return the range (5th to 95th percentile) of the lowest joint's height along an axis; median over clips."""
    lowest = np.fmin.reduce(body @ up_vector(up), axis=1)
    spreads = []
    for index in [0] if clip is None else np.unique(clip):
        known = lowest[np.isfinite(lowest) & (True if clip is None else clip == index)]
        if len(known):
            low, high = np.percentile(known, (5, 95))
            spreads.append(float(high - low))
    return float(np.median(spreads)) if spreads else float("inf")


def _is_rooted(body: Array) -> bool:
    """Return whether the hips' midpoint, or the pelvis, is at the origin in all frames; False for a single frame."""
    middle = (body[:, JOINT["right_hip"]] + body[:, JOINT["left_hip"]]) / 2
    known = (root[np.isfinite(root).all(axis=-1)] for root in (middle, body[:, JOINT["pelvis"]]))
    return any(len(root) > 1 and np.abs(root).max() < ROUNDING_METRES for root in known)


def times(
    frames: int,
    time: Array | None,
    rate: float | None,
    options: Options,
    clip: Ints | None = None,
    frame: Ints | None = None,
) -> Array | None:
    """Return the time of each frame (T,), seconds, from time stamps or else from a rate; None if both are unknown.

    Contradictions between times and rates are added to the warnings. Rows with the same frame number are alternative
    postures of that frame.
    """
    stated = rate if rate is not None and 0 < rate < np.inf else None
    clip = np.zeros(frames, dtype=np.intp) if clip is None else clip
    if time is not None and np.isfinite(time).any():
        counted = (np.diff(clip) == 0) & (True if frame is None else np.diff(frame) != 0)
        steps = np.diff(time)[counted]
        step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
        for given, whose in ((stated, "the file's rate"), (options.rate, "--rate")):
            if given and step and abs(step * given - 1) > RATE_DISAGREES:
                contradiction = f"times are {step:.4g} s apart and contradict {whose} {given:g} a second"
                options.warn(f"{contradiction}: times are kept")
        if step or not len(steps) or not (stated or options.rate):
            if (steps <= 0).any():
                options.warn(f"times do not increase at {(steps <= 0).sum()} of {len(steps)} steps")
            return _unrounded(time, stated, options) if counted.all() else time
        options.warn("times do not increase: the rate is used instead")
    if stated and options.rate and abs(stated / options.rate - 1) > 1e-6:
        options.warn(f"--rate {options.rate:g} is used in place of the file's {stated:g} Hz")
    used = options.rate or stated
    if used is None:
        if frames > 1:
            options.note("the file has no times and no rate above 0 (--rate)")
        return None
    first = np.concatenate([[True], np.diff(clip) != 0])
    number = np.arange(frames) - np.flatnonzero(first)[np.cumsum(first) - 1]
    return np.asarray((number if frame is None else frame) / used)


def _unrounded(time: Array, stated: float | None, options: Options) -> Array:
    """Return evenly spaced times (T,) if a file's times are rounded even times, such as 0.017, 0.033, 0.05."""
    digits = next((d for d in range(7) if np.array_equal(np.round(time, d), time)), None)
    if digits is None or len(time) < 3 or not time[-1] > time[0]:
        return time
    whole = (len(time) - 1) / (time[-1] - time[0])
    for rate in (stated or whole, float(round(whole)), whole):
        even = time[0] + np.arange(len(time)) / (rate or np.nan)
        if np.abs(even - time).max() <= 0.51 * 10.0**-digits:
            if np.abs(even - time).max() > NOTED_SECONDS:
                options.note(f"times are rounded to {digits} decimals: even steps of 1/{rate:g} s are used")
            return np.asarray(even)
    return time
