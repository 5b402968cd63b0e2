"""Settings of recoveries and validations, as immutable classes.

Each field of these classes is also an option of the command line. Quantities can be numbers, or text with a unit such
as ``"175cm"``.
"""

from __future__ import annotations

import math
import string
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, Literal, Self, get_args

from posekit.errors import check_names, refusal, shown
from posekit.files import parse_toml, read_bytes
from posekit.geometry import PER_METRE, UNIT_WORDS, Record

#: Number of units in one metre, pixel, degree, second or hertz, for quantities given as text; 100 % is one.
UNITS: Final = {
    **PER_METRE,
    "in": 1 / 0.0254,
    **dict.fromkeys(("ft", "feet", "foot"), 1 / 0.3048),
    **dict.fromkeys(("", "px", "pixels", "deg", "degrees", "°", "s", "seconds", "hz", "hertz", "fps"), 1.0),
    **dict.fromkeys(("%", "percent"), 100.0),
}

#: Largest accepted relative standard deviation of lengths (dimensionless).
MAX_LENGTH_DEVIATION: Final = 0.3

#: Largest accepted standard deviation of image points, pixels.
MAX_DEVIATION: Final = 1000.0

Root = Literal["auto", "given", "head", "torso", "search"]
Proportions = Literal["auto", "figure", "people", "taylor"]
Bodies = Literal["auto", "meshes", "capsules", "none"]
Walkers = Literal["paper", "people", "paper-printed"]


def number(
    text: str | float,
    name: str,
    expected: str = "a number, with or without its unit",
    remedy: str = "correct it",
) -> float:
    """Read a quantity such as ``1.75``, ``"175cm"`` or ``"2px"`` in metres, pixels, degrees or seconds.

    Parameters
    ----------
    text : str or float
        The quantity. A bare number is in the base unit.
    name : str
        Name of the argument, for the error message.
    expected, remedy : str
        The expected value and the remedy, for the error message.

    Raises
    ------
    InputError
        If the text is not a finite number with a known unit or without a unit.

    Examples
    --------
    >>> number("175cm", "stature"), number(2, "deviation")
    (1.75, 2.0)
    """
    given = str(text).strip().lower()
    digits = given.rstrip(string.ascii_lowercase + "%°")
    unit = given.removeprefix(digits)
    try:
        value = float(digits) / UNITS[UNIT_WORDS.get(unit, unit)]
    except (KeyError, ValueError):
        raise refusal("", name, shown(text), expected, remedy) from None
    if not math.isfinite(value):
        raise refusal("", name, shown(text), expected, "give a finite number")
    return value


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """Tolerances of the checks of a posture; larger tolerances are for measured lengths and image points.

    Parameters
    ----------
    rigid : float
        Tolerance of shoulder width, hip width and the distances from shoulders to pelvis, metres.
    tangent : float
        Largest gap between the end of a segment and the ray of its image point if the segment is too short, metres. The
        joint is then at the nearest point of the ray.
    angle : float
        Tolerance of segment directions and joint angles, degrees.
    hips : float
        Tolerance of the distance between the hips as a share of `rigid`, 0 to 1. A share below 1 is for measured
        people, whose pelvis is more rigid than the torso.
    """

    rigid: float
    tangent: float
    angle: float = 1e-3
    hips: float = 1.0

    @property
    def exact(self) -> bool:
        """Whether the tolerances allow rounding errors only."""
        return self.rigid <= EXACT.rigid


#: Tolerance for exact image points: rounding errors only.
EXACT: Final = Tolerance(rigid=1e-8, tangent=1e-9)

#: Tolerance for measured points. Distances inside a real torso vary by centimetres (CMU motion capture, 16 clips).
MEASURED: Final = Tolerance(rigid=0.03, tangent=0.01, angle=2.0, hips=0.25)

#: Tolerance for uncalibrated pictures. The true scale differs by some percent between near and far limbs.
PHOTOGRAPH: Final = Tolerance(rigid=0.10, tangent=0.05, angle=10.0)


@dataclass(frozen=True, kw_only=True, repr=False)
class Settings(Record):
    """Common settings of recoveries and validations.

    Parameters
    ----------
    checks : sequence of str or Check, optional
        Checks: names of built-in checks, ``module:Name`` for own checks, or check objects. ``usual`` selects the
        default checks.
    ranges : str
        Joint ranges: ``anatomical``, ``urdf``, ``table1`` or the path of a TOML file. ``auto`` selects ``urdf`` for
        robot configurations and ``anatomical`` otherwise.
    rules : sequence of int
        Numbers (1 to 5) of Lee & Chen's walking rules that the check ``walking`` tests.
    walkers : {"paper", "people", "paper-printed"}
        Thresholds of the walking rules: Lee & Chen's (``paper``) or those of real walkers (``people``).
        ``paper-printed`` uses Lee & Chen's thresholds, and derives the walking direction from the head.
    contact_margin : float
        Minimum distance between the collision geometries of two body parts, metres. A negative distance allows
        penetration.
    rigid_tolerance : float, optional
        Tolerance of shoulder width, hip width and the distances from shoulders to pelvis, metres.
    angle_tolerance : float, optional
        Tolerance of joint ranges, degrees.
    """

    checks: Sequence[Any] | None = None
    ranges: str = "anatomical"
    rules: Sequence[int] = (1, 2)
    walkers: Walkers = "paper"
    contact_margin: float = 0.0
    rigid_tolerance: float | None = None
    angle_tolerance: float | None = None

    def __post_init__(self) -> None:
        for one in fields(self):
            if one.type in ("str", "str | None") and getattr(self, one.name) is not None:
                self._set(one.name, str(getattr(self, one.name)))
            if one.type in ("bool", "bool | None") and getattr(self, one.name) not in (True, False, None):
                got = shown(getattr(self, one.name))
                raise refusal("", one.name, got, "true or false", "write one of them")
        if isinstance(self.checks, str):
            self._set("checks", tuple(name.strip() for name in self.checks.split(",") if name.strip()))
        elif self.checks is not None:
            self._set("checks", tuple(self.checks) if isinstance(self.checks, Iterable) else (self.checks,))
        if isinstance(self.rules, str):
            rules = map(str.strip, self.rules.split(","))
            self._set("rules", tuple(int(rule) if rule.isdigit() else rule for rule in rules if rule))
        self._set("rules", tuple(self.rules) if isinstance(self.rules, Iterable) else (self.rules,))
        self._one_of("walkers", get_args(Walkers))
        if not set(self.rules) <= {1, 2, 3, 4, 5}:
            raise refusal("", "rules", shown(list(self.rules)), "some of 1, 2, 3, 4, 5", "give them as 1,2")
        self._number("contact_margin", None)
        for name in ("rigid_tolerance", "angle_tolerance"):
            self._number(name, 0.0)

    @classmethod
    def of(cls, settings: Settings | None, **changes: Any) -> Self:
        """Return the given settings, or the defaults, with the fields in `changes` replaced; None changes nothing.

        Raises
        ------
        InputError
            If `settings` is of another class, a field is unknown, or its value is impossible.
        """
        if settings is not None and not isinstance(settings, cls):
            got, expected = shown(type(settings).__name__), f"a {cls.__name__}"
            raise refusal("", "settings", got, expected, "see posekit settings")
        return (settings or cls()).changed(**stated(**changes))

    def changed(self, **fields_given: Any) -> Self:
        """Return a copy of the settings with the given fields replaced.

        Raises
        ------
        InputError
            If a field is unknown or its value is impossible.
        """
        known = [one.name for one in fields(self)]
        expected = f"a field of {type(self).__name__}"
        check_names("settings", fields_given, known, kind="field", expected=expected)
        return replace(self, **fields_given) if fields_given else self

    @classmethod
    def from_toml(cls, path: str | Path, base: Self | None = None) -> Self:
        """Return `base`, or the default settings, with the fields in a TOML file replaced.

        Raises
        ------
        InputError
            If the file cannot be read or a field is wrong.
        """
        return (base or cls()).changed(**parse_toml(read_bytes(path), str(path)))

    def to_json(self) -> dict[str, Any]:
        """Return the fields as JSON values; check objects are replaced by their names."""
        return {one.name: _plain(getattr(self, one.name)) for one in fields(self)}

    def _one_of(self, name: str, allowed: Sequence[str]) -> None:
        if getattr(self, name) not in allowed:
            raise refusal("", name, shown(getattr(self, name)), f"one of {', '.join(allowed)}", "correct it")

    def _number(
        self, name: str, lower: float | None, upper: float = math.inf, remedy: str = "correct it"
    ) -> None:
        """Convert the quantity in a field from text to a number, and raise an error if it is outside the bounds."""
        given = getattr(self, name)
        if given is None:
            return
        expected = "a finite number" if lower is None else f"a number from {lower:g}"
        expected += f" to {upper:g}" if math.isfinite(upper) else ""
        value = number(given, name, expected, remedy)
        if (lower is not None and value < lower) or value > upper:
            raise refusal("", name, shown(given), expected, remedy)
        self._set(name, value)


@dataclass(frozen=True, kw_only=True, repr=False)
class RecoverSettings(Settings):
    """Settings of a recovery: the fields of `Settings` and the following fields.

    Parameters
    ----------
    tangent_tolerance : float, optional
        Largest gap between the end of a segment and the ray of its image point if the segment is too short, metres.
    deviation : float, optional
        Standard deviation of the image points, pixels. Default: the deviation in the view's file.
    length_deviation : float, optional
        Relative standard deviation of the person's size and of each segment length, 0 to 0.3. 0 means exact lengths.
    stature : float, optional
        Height of the person, metres.
    root : {"auto", "given", "head", "torso", "search"}
        Source of the neck position: ``given`` uses the position in the view, ``head`` computes it from six head points,
        ``torso`` estimates it together with the posture. ``auto`` selects the first of these sources that the view
        allows; ``search`` is a synonym of ``auto``.
    proportions : {"auto", "figure", "people", "taylor"}
        Relative segment lengths if none are given: ``figure`` (built-in human model), ``people`` (means of people, the
        default for key points and photographs), or ``taylor`` (Taylor's Table 1, only without a camera).
    scale : str, optional
        Scale of an uncalibrated view: ``min``, ``likely``, a number of pixels per metre, ``stature:PX``, or weighted
        constraints such as ``closure:1,coplanar:0.5``.
    nearer : mapping or sequence of mapping, optional
        Known directions of segments: a mapping from the name of a segment to the name of its joint that is nearer to
        the camera. One mapping for all frames, or one mapping per frame.
    infer : bool
        Infer the positions of joints without image points.
    refine : bool, optional
        Recover with the least-squares solver for noisy image points. Default: only if the image points cannot be exact.
    coverage : float
        Minimum total probability of the listed postures, 0 to 1.
    group : float, optional
        Group survivors whose joints are all within this distance of the group's most probable survivor, metres.
        Default: no groups.
    follow : int
        Number of paths to compute: the most probable sequences of one survivor per frame.

    Examples
    --------
    >>> RecoverSettings(stature="175cm", coverage=1).stature
    1.75
    """

    tangent_tolerance: float | None = None
    deviation: float | None = None
    length_deviation: float | None = None
    stature: float | None = None
    root: Root = "auto"
    proportions: Proportions = "auto"
    scale: str | None = None
    nearer: Any = None
    infer: bool = True
    refine: bool | None = None
    coverage: float = 0.99
    group: float | None = None
    follow: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._one_of("root", get_args(Root))
        if self.root == "search":  # the solver searches all depths anyway
            self._set("root", "auto")
        self._one_of("proportions", get_args(Proportions))
        self._number("tangent_tolerance", 0.0, remedy="give metres, or write the unit as in 2cm")
        self._number("deviation", 0.0, MAX_DEVIATION)
        self._number("length_deviation", 0.0, MAX_LENGTH_DEVIATION)
        self._number("stature", 0.1, 10.0, "give metres, or write the unit as in 175cm")
        self._number("coverage", 0.0, 1.0)
        self._number("group", 0.0)
        self._number("follow", 0.0)
        self._set("follow", int(self.follow))

    def tolerance(self, usual: Tolerance) -> Tolerance | None:
        """Return the tolerances set here, with missing ones from `usual`; None if no tolerance is set."""
        given = (self.rigid_tolerance, self.tangent_tolerance, self.angle_tolerance)
        if all(part is None for part in given):
            return None
        rigid, tangent, angle = (
            own if part is None else part
            for part, own in zip(given, (usual.rigid, usual.tangent, usual.angle), strict=True)
        )
        return Tolerance(rigid=rigid, tangent=tangent, angle=angle)


@dataclass(frozen=True, kw_only=True, repr=False)
class ValidateSettings(Settings):
    """Settings of a validation: the fields of `Settings` and the following fields.

    Parameters
    ----------
    noise : float, optional
        Standard deviation of measured coordinates, metres. Default: estimated from the variation of limb lengths.
    strict : bool
        Check that postures have the lengths of the human model, with tolerances for rounding errors only.
    ground : float, optional
        Height of the ground along the up axis, metres. Default: estimated from each clip.
    profile : str
        Profile of checks over time and their thresholds: ``posekit``, ``phuma``, ``protomotions``, ``holomotion``,
        ``skating`` or the path of a TOML file.
    bodies : {"auto", "meshes", "capsules", "none"}
        Collision geometries of a robot: ``meshes`` (the geometries in the URDF), ``capsules`` (along the limbs) or
        ``none``. ``auto`` selects capsules if no two geometries of the URDF can touch.
    srdf : str, optional
        Path of the robot's SRDF. The collision check ignores the pairs of links that the SRDF disables.
    package_dirs : sequence of str
        Folders that hold the packages of the robot's meshes.
    joint_map : str, optional
        Name or path of the joint map, which assigns frames of the robot to the 14 joints of the figure.

    Examples
    --------
    >>> ValidateSettings(checks="joint-range,collision", ground="0cm").checks
    ('joint-range', 'collision')
    """

    ranges: str = "auto"
    noise: float | None = None
    strict: bool = False
    ground: float | None = None
    profile: str = "posekit"
    bodies: Bodies = "auto"
    srdf: str | None = None
    package_dirs: Sequence[str] = ()
    joint_map: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._one_of("bodies", get_args(Bodies))
        self._number("noise", 0.0)
        self._number("ground", None)
        dirs = (self.package_dirs,) if isinstance(self.package_dirs, str) else self.package_dirs
        self._set("package_dirs", tuple(map(str, dirs)))


def stated(**given: Any) -> dict[str, Any]:
    """Return the arguments that are not None."""
    return {name: one for name, one in given.items() if one is not None}


def picture_size(size: Any) -> tuple[int, int] | None:
    """Convert a size, given as two numbers or as ``"1280x720"``, to width and height; return None if not given."""
    if size is None or size == "":
        return None
    text = size if isinstance(size, str) or not isinstance(size, Iterable) else "x".join(map(str, size))
    sides = str(text).lower().split("x")
    if len(sides) != 2 or not all(side.isdigit() and int(side) for side in sides):
        raise refusal("", "size", shown(size), "WIDTHxHEIGHT in pixels", "write it as 1280x720")
    return int(sides[0]), int(sides[1])


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if isinstance(value, Path):
        return str(value)
    return (
        value
        if value is None or isinstance(value, str | int | float | bool)
        else getattr(value, "name", str(value))
    )
