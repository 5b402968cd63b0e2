"""Settings of a recovery and of a validation: one frozen record each, passed on as a whole.

The command line makes its options from the fields of these records. Lengths and pixels can be given as numbers or as
text with a unit.
"""

from __future__ import annotations

import math
import string
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, Literal, Self, get_args

from posekit.errors import nearest, refusal, shown
from posekit.geometry import PER_METRE, UNIT_WORDS, Record

#: Units of numbers given as text, and how many of each make one metre, pixel, degree, second or hertz; 100 % is one.
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
        Name of the argument, for the error.
    expected, remedy : str
        The expected value and the remedy, for the error.

    Raises
    ------
    InputError
        If it is not a finite number with a known unit.

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
    """Allowed differences between a posture and the body, for lengths and image points that are not exact.

    Parameters
    ----------
    rigid : float
        Distances within torso and hips, metres.
    tangent : float
        Shortfall of a segment against its image, metres: its end is then put at the nearest point of the ray.
    angle : float
        Directions of segments and joint angles, degrees.
    hips : float
        Allowed difference of the distance between the hips as a part of `rigid`, 0 to 1: the pelvis is bone.
    """

    rigid: float
    tangent: float
    angle: float = 1e-3
    hips: float = 1.0

    @property
    def exact(self) -> bool:
        """Whether only rounding is allowed."""
        return self.rigid <= EXACT.rigid


#: Tolerance for exact image points: rounding only.
EXACT: Final = Tolerance(rigid=1e-8, tangent=1e-9)

#: For measured points and bodies: a real torso varies by centimetres (CMU motion capture, 16 clips).
MEASURED: Final = Tolerance(rigid=0.03, tangent=0.01, angle=2.0, hips=0.25)

#: For uncalibrated pictures: the scale differs by some percent between near and far limbs.
PHOTOGRAPH: Final = Tolerance(rigid=0.10, tangent=0.05, angle=10.0)


@dataclass(frozen=True, kw_only=True, repr=False)
class Settings(Record):
    """Settings that recoveries and validations share.

    Parameters
    ----------
    checks : sequence of str or Check, optional
        Checks by name, as ``module:Name``, or as objects; ``usual`` stands for the default ones.
    ranges : str
        Joint ranges: ``anatomical``, ``urdf``, ``table1`` or the path of a TOML table; ``auto``: anatomical, and for
        configurations the limits of their URDF.
    rules : sequence of int
        Rules of walking, 1 to 5, for the check ``walking``.
    walkers : {"paper", "people", "paper-printed"}
        Source of the walking rules' thresholds: the paper, real walkers, or the paper as printed.
    contact_margin : float
        Distance that bodies must keep, metres; negative allows penetration.
    rigid_tolerance : float, optional
        Allowed difference of distances within rigid parts, metres.
    angle_tolerance : float, optional
        Allowed excess of joint angles beyond their range, degrees.
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
        if isinstance(self.checks, str):
            self._set("checks", tuple(name.strip() for name in self.checks.split(",") if name.strip()))
        elif self.checks is not None:
            self._set("checks", tuple(self.checks) if isinstance(self.checks, Iterable) else (self.checks,))
        if isinstance(self.rules, str):
            rules = map(str.strip, self.rules.split(","))
            self._set("rules", tuple(int(rule) if rule.isdigit() else rule for rule in rules if rule))
        self._set("rules", tuple(self.rules))
        self._one_of("walkers", get_args(Walkers))
        if not set(self.rules) <= {1, 2, 3, 4, 5}:
            raise refusal("", "rules", shown(list(self.rules)), "some of 1, 2, 3, 4, 5", "give them as 1,2")
        self._number("contact_margin", None)
        for name in ("rigid_tolerance", "angle_tolerance"):
            self._number(name, 0.0)

    @classmethod
    def of(cls, settings: Settings | None, **changes: Any) -> Self:
        """Return the settings, the defaults if they are None, with the changes that are not None.

        Raises
        ------
        InputError
            If they are settings of another kind, a field is unknown, or its value is impossible.
        """
        if settings is not None and not isinstance(settings, cls):
            got, expected = shown(type(settings).__name__), f"a {cls.__name__}"
            raise refusal("", "settings", got, expected, "see posekit settings")
        return (settings or cls()).changed(**stated(**changes))

    def changed(self, **fields_given: Any) -> Self:
        """Return the settings with some fields changed.

        Raises
        ------
        InputError
            If a field is unknown or its value is impossible.
        """
        known = [one.name for one in fields(self)]
        for name in fields_given:
            if name not in known:
                expected = f"a field of {type(self).__name__}"
                raise refusal("settings", name, "an unknown field", expected, nearest(name, known))
        return replace(self, **fields_given) if fields_given else self

    @classmethod
    def from_toml(cls, path: str | Path, base: Self | None = None) -> Self:
        """Read fields from a TOML file on top of `base`, or of the defaults.

        Raises
        ------
        InputError
            If the file cannot be read or a field is wrong.
        """
        try:
            found = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise refusal(path, "", str(error), "a TOML file of settings", "see `posekit settings`") from None
        return (base or cls()).changed(**found)

    def to_json(self) -> dict[str, Any]:
        """Return the fields as JSON values; a check that is an object is given by its name."""
        return {one.name: _plain(getattr(self, one.name)) for one in fields(self)}

    def _one_of(self, name: str, allowed: Sequence[str]) -> None:
        if getattr(self, name) not in allowed:
            raise refusal("", name, shown(getattr(self, name)), f"one of {', '.join(allowed)}", "correct it")

    def _number(
        self, name: str, lower: float | None, upper: float = math.inf, remedy: str = "correct it"
    ) -> None:
        """Replace a quantity that is given as text by its number, and refuse one outside its bounds."""
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
    """Settings of a recovery: the fields of `Settings`, and those listed here.

    Parameters
    ----------
    tangent_tolerance : float, optional
        Allowed shortfall of a segment against its image, metres.
    deviation : float, optional
        Standard deviation of the image points, pixels. The view's own by default.
    length_deviation : float, optional
        Relative standard deviation of the body's size and of each length, 0 to 0.3; 0 means exact lengths.
    stature : float, optional
        Height of the person, metres.
    root : {"auto", "given", "head", "torso", "search"}
        Source of the neck's place: the view, six head points, or the body. ``search`` is ``auto``.
    proportions : {"auto", "figure", "people", "taylor"}
        Relative lengths of a person whose lengths are not given: the figure's; those of people's joints, the default
        for key points and photographs; or, without a camera, Taylor's Table 1.
    scale : str, optional
        Scale of an uncalibrated view: ``min``, ``likely``, a number in pixels a metre, ``stature:PX`` or constraints
        such as ``closure:1,coplanar:0.5``.
    nearer : mapping or sequence of mapping, optional
        Flips given by hand: segment to the name of its nearer end, for all frames or one mapping a frame.
    infer : bool
        Infer the positions of unseen joints.
    refine : bool, optional
        Treat image points as noisy. By default only if the points cannot be exact.
    coverage : float
        Minimum share of the probability that the listed postures hold, 0 to 1.
    group : float, optional
        Distance within which survivors form a group, metres.
    follow : int
        Number of paths through the frames to follow; 0 for none.

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
        """Return the tolerance that is given, completed from the `usual` one; None if no part is given."""
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
    """Settings of a validation: the fields of `Settings`, and those listed here.

    Parameters
    ----------
    noise : float, optional
        Standard deviation of measured coordinates, metres. By default it is estimated from the limbs' lengths.
    strict : bool
        Judge postures as the model's own: with its lengths, and a tolerance for rounding only.
    ground : float, optional
        Height of the ground along the up axis, metres. By default it is estimated from each clip.
    profile : str
        Checks over time and their thresholds: ``posekit``, ``phuma``, ``protomotions``, ``holomotion`` or the path of
        a TOML table.
    bodies : {"auto", "meshes", "capsules", "none"}
        Collision bodies of a robot: its URDF's, capsules, or none. ``auto`` takes capsules if no two bodies of the URDF
        can touch.
    srdf : str, optional
        Path of the robot's SRDF, which lists pairs that are not checked.
    package_dirs : sequence of str
        Folders that hold the packages of the robot's meshes.
    joint_map : str, optional
        Name or path of the table of frames that stand for the joints.

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
    """Return a width and a height, given as two numbers or as ``"1280x720"``; None if nothing is given."""
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
