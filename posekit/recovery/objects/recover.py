"""Every posture of any articulated object behind an uncalibrated view (Taylor 2000)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError, PosekitError, refusal, shown
from posekit.geometry import Array, Record
from posekit.recovery.objects.configurations import configurations_of
from posekit.recovery.objects.family import LinkageFamily
from posekit.recovery.objects.growth import CLOSED_RESIDUAL, EXACT, MEASURED, Tolerance, grow_best
from posekit.recovery.objects.linkage import Linkage, name_nearer, read_nearer
from posekit.recovery.objects.scale import CONSTRAINT_KINDS, search

#: Largest number of scales of a frame; the scales with the smallest residuals are used.
MAX_SCALES: Final = 128


def parse_scale(text: str) -> tuple[str, float, dict[str, float]]:
    """Parse the setting `scale`: return its kind, its number, and the weights of constraints.

    Parameters
    ----------
    text : str
        ``min``, ``likely``, a number in pixels per unit of length, ``stature:PX``, or constraints with optional weights
        as ``closure:1,coplanar:0.5``.

    Raises
    ------
    InputError
        If the text has none of these forms.

    Examples
    --------
    >>> parse_scale("closure,coplanar:0.5")
    ('constraints', 0.0, {'closure': 1.0, 'coplanar': 0.5})
    """
    text = str(text).strip()
    if text in ("min", "likely"):
        return text, 0.0, {}
    parts = [part.strip().partition(":") for part in text.split(",")]
    constraints = all(name in CONSTRAINT_KINDS for name, _, _ in parts)
    try:
        weights = {name: float(value or 1) for name, _, value in parts} if constraints else {}
        number = 0.0 if constraints else float(text.removeprefix("stature:"))
    except ValueError:
        weights, number = {}, math.nan
    if not all(math.isfinite(value) and value > 0 for value in weights.values() or (number,)):
        expected = f"min, likely, a positive number, stature:PX, or some of {', '.join(CONSTRAINT_KINDS)}"
        raise refusal("", "scale", shown(text), expected, "correct it")
    how = "constraints" if constraints else "stature" if text.startswith("stature:") else "value"
    return how, number, weights


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ObjectRecovery(Record):
    """Result of `recover_object`: every posture of an object that fits a view.

    Parameters
    ----------
    linkage : Linkage
    frame : int array (N,)
        Frame of each posture.
    points : array (N, P, 3)
        Positions, camera frame, in the linkage's unit; NaN if a point is not seen.
    flips : int array (N, S)
        1 if the first end of a segment is nearer, -1 if the second end is nearer, 0 if both have the same depth or the
        segment is not seen.
    scale : array (N,)
        Pixels per unit of length.
    q : array (N, nq), optional
        Configurations of the robot; NaN if none was computed.
    distance : array (N,), optional
        Largest distance between a point of the configuration and the same point of the posture, in metres if the
        linkage states its unit.
    certified : bool array (N,), optional
        True if a configuration within the joint limits has the posture. False means undecided: the search found no such
        configuration.
    frames : sequence of mapping
        ``time``, ``judged``, ``reason``, ``rejected`` and ``family`` (``how``, ``bound``, ``segment``, ``chosen``,
        ``minima``, ``curve``) of each frame.
    configuration_names : sequence of str
    settings : mapping
    """

    linkage: Linkage
    frame: NDArray[np.intp]
    points: Array
    flips: NDArray[np.int8]
    scale: Array
    q: Array | None = None
    distance: Array | None = None
    certified: NDArray[np.bool_] | None = None
    frames: Sequence[Mapping[str, Any]] = ()
    configuration_names: Sequence[str] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        """Count the frames."""
        return len(self.frames)

    def document(self) -> dict[str, Any]:
        """Return the result as JSON values (``posekit.object/1``), in metres if the linkage states its unit."""
        linkage, factor = self.linkage, self.linkage.unit or 1.0
        frames = []
        for k, about in enumerate(self.frames):
            postures: list[dict[str, Any]] = []
            for row in np.flatnonzero(self.frame == k).tolist():
                points = [[round(x, 12) for x in point] for point in (self.points[row] * factor).tolist()]
                one: dict[str, Any] = {
                    "points": [None if np.isnan(point[0]) else point for point in points],
                    "flips": name_nearer(linkage, self.flips[row]),
                    "scale": float(self.scale[row] / factor),
                }
                if self.q is not None and self.distance is not None and self.certified is not None:
                    one["certified"] = bool(self.certified[row])
                    one["q"] = None if np.isnan(self.q[row]).any() else self.q[row].tolist()
                    one["fk_distance"] = None if np.isnan(self.distance[row]) else float(self.distance[row])
                postures.append(one)
            frames.append({**about, "postures": postures})
        return {
            "schema": "posekit.object/1",
            "unit": None if linkage.unit is None else "m",
            "linkage": linkage.name,
            "points": list(linkage.points),
            "segments": list(linkage.segment_names),
            "lengths": (linkage.lengths * factor).tolist(),
            "configuration_names": list(self.configuration_names),
            "settings": dict(self.settings),
            "frames": frames,
        }


def recover_object(
    linkage: Linkage,
    image: ArrayLike,
    *,
    scale: str | float | None = None,
    aspect: float = 1.0,
    time: ArrayLike | None = None,
    nearer: Mapping[str, str] | Sequence[Mapping[str, str]] = (),
    tolerance: tuple[float, float] | None = None,
    robot: Any = None,
) -> ObjectRecovery:
    """Find every posture of an object that projects onto the given image points.

    Parameters
    ----------
    linkage : Linkage
    image : array (F, P, 2)
        Pixels, y down; unseen points are NaN.
    scale : str or float, optional
        ``min`` (default), pixels per unit of length, ``stature:PX``, or constraints (`parse_scale`).
    aspect : float
        Ratio of a pixel's width to its height.
    time : array (F,), optional
        Seconds.
    nearer : mapping or sequence of F mappings
        Stated flips: the nearer end by segment.
    tolerance : (float, float), optional
        Allowed error of lengths that close a loop, and allowed shortfall of segments, in the linkage's unit. By default
        zero up to rounding if the points of the frame are exact, otherwise 1 and 2 % of the longest segment. Closed
        loops, coplanar or collinear points show that points are exact.
    robot : Robot, optional
        `posekit.robots.Robot` whose frames include the linkage's points; configurations within its limits are computed.

    Raises
    ------
    InputError
        If a name is unknown, or the data of every frame contradict each other; the message is the first frame's reason.

    Examples
    --------
    >>> import numpy as np
    >>> rod = Linkage.from_names(name="rod", segments={("a", "b"): 5.0, ("b", "c"): 3.0})
    >>> found = recover_object(rod, [[[0.0, 0.0], [30.0, 0.0], [30.0, 30.0]]], scale=10.0)
    >>> found.points[..., 2].round(9) + 0.0
    array([[ 0., -4., -4.],
           [ 0.,  4.,  4.]])
    """
    images = np.asarray(image, dtype=np.float64)
    hands = read_nearer(linkage, nearer, len(images))
    times = np.arange(len(images)) if time is None else np.asarray(time, dtype=np.float64)
    longest = float(linkage.lengths.max())
    given = None if tolerance is None else Tolerance(*tolerance, tolerance[1] / 2)
    tables: list[tuple[Array, Array, Array]] = []
    frames: list[dict[str, Any]] = []
    for picture, hand, at in zip(images, hands, times.tolist(), strict=True):
        about: dict[str, Any] = {"time": at, "judged": None, "reason": "", "rejected": {}}
        grown = (np.empty((0, len(linkage.points), 3)), np.empty((0, len(linkage.lengths))), np.empty(0))
        try:
            family = LinkageFamily(linkage=linkage, image=picture, aspect=aspect)
            about["family"], chosen = _scales(family, scale, hand, given)
            grown = grow_best(family, chosen, hand, given, about)
        except PosekitError as error:
            about["reason"] = str(error)
        tables.append(grown)
        frames.append(about)
    if frames and all(about["reason"] for about in frames):
        raise InputError(f"frames[0]: {frames[0]['reason']}")
    frame = np.repeat(np.arange(len(tables)), [len(part[0]) for part in tables])
    points, flips, scales = (np.concatenate([one[k] for one in tables]) for k in range(3))
    table = {"frame": frame, "points": points, "flips": flips.astype(np.int8), "scale": scales}
    if robot is not None:
        exact = np.array([about["judged"] == "exact" for about in frames])[frame]
        within = np.where(exact, 2 * EXACT.rigid, MEASURED.tangent) * longest * (linkage.unit or 1.0)
        table |= configurations_of(robot, linkage, points, frame, within)
        order = np.lexsort((~table["certified"], frame))
        table = {name: values[order] for name, values in table.items()}
    return ObjectRecovery(
        linkage=linkage,
        frames=frames,
        configuration_names=() if robot is None else tuple(robot.configuration_names),
        settings={
            "scale": None if scale is None else str(scale),
            "nearer": [name_nearer(linkage, hand) for hand in hands],
        },
        **table,
    )


def _scales(
    family: LinkageFamily, scale: str | float | None, hand: NDArray[np.int8], given: Tolerance | None
) -> tuple[dict[str, Any], Array]:
    """Return the scales (K,) of one frame, and the entries of `family` in the result that describe them."""
    linkage = family.linkage
    longest = float(linkage.lengths.max())
    bound = family.minimum_scale
    how, value, weights = parse_scale("min" if scale is None else str(scale))
    factor = linkage.unit or 1.0
    about: dict[str, Any] = {"how": how, "bound": bound / factor, "segment": family.bounding_segment}
    chosen = np.array([bound])
    if how == "constraints":
        found = search(family, weights, hand)
        about["how"] = "+".join(weights)
        pairs = zip((found.s / factor).tolist(), found.residual.tolist(), strict=True)
        about["minima"] = [{"s": s, "residual": residual} for s, residual in pairs]
        about["curve"] = {"s": (found.curve_s / factor).tolist(), "residual": found.curve_residual.tolist()}
        closed = found.residual <= CLOSED_RESIDUAL
        every = found.s[closed] if closed.any() else found.s
        _, first = np.unique(np.round(np.log(every), 9), return_index=True)
        chosen = every[np.sort(first)][:MAX_SCALES] if len(every) else chosen
    elif how in ("value", "stature"):
        if how == "stature" and linkage.height is None:
            remedy = "add height to it, or give the scale"
            raise refusal("", "scale", "stature", "a linkage with a height", remedy)
        s = value * factor if how == "value" else value / float(linkage.height or 1.0)
        lost = (bound / s - 1) * longest
        if lost > (given.tangent if given else EXACT.tangent * longest):
            needs = f"at least {bound / factor:.6g}, which {family.bounding_segment} needs"
            raise refusal("", "scale", f"{value:.6g}", needs, "give more, or --scale min")
        chosen = np.array([max(s, bound)])
    about["chosen"] = (chosen / factor).tolist()
    return about, chosen
