"""`Check`, the protocol of checks of postures and motion, and `Judgement`, the result of a check.

A check is any object with the four members of `Check`. Checks of postures, configurations and motion have one form:

    class FeetAboveGround:
        '''A foot is below the ground.'''

        name = "feet-above-ground"
        unit = "m"
        reads = ("joints", "ground")

        def judge(self, body):
            height = body.joints[:, [12, 13]] @ body.up - body.ground
            return Judgement(("right_ankle", "left_ankle"), height, lower=0.0, tolerance=0.01)

The docstring is the message of the findings. A check may have two more members. `points` is a sequence of the names of
the points that the check reads. While `posekit.recover` searches its binary tree, it applies the check as soon as these
points have positions. `residuals(joints)` is a method that the least-squares solver calls with postures (N, 14, 3). It
returns residuals (N, K): the excess of each value over its bound, in standard deviations; 0 inside the bounds.
"""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from posekit.errors import PosekitError, cut, nearest, refusal
from posekit.geometry import Array, Record

if TYPE_CHECKING:
    from posekit.validators.body import Body

#: Entry-point group in which other packages register their checks.
ENTRY_POINTS: Final = "posekit.checks"

#: Data of a body that a check may read, and the reason in the report if a body does not have these data.
READABLE: Final[Mapping[str, str]] = {
    "joints": "no joint positions are known",
    "head": "no head points are known",
    "feet": "no toes or heels are known",
    "q": "there are no configurations of a robot (--urdf)",
    "robot": "there are no configurations of a robot (--urdf)",
    "time": "the frame rate is not known (--rate)",
    "up": "the direction up is not known (--up)",
    "ground": "the height of the ground is not known (--up, --ground)",
}

#: Form of a check's name.
CHECK_NAME: Final = re.compile(r"[a-z][a-z0-9-]*")


class NotAskedError(PosekitError):
    """A check does not apply to a body; `Check.judge` may raise this error, and reports show its message."""


@dataclass(frozen=True, eq=False, repr=False)
class Judgement(Record):
    """Result of a check: values and bounds of K quantities, such as joint angles, in T frames.

    Parameters
    ----------
    places : sequence of K str
        Names of the judged angles, segments or pairs of bodies.
    value : array (T, K)
        Judged values in the check's unit; NaN for an undecided value.
    lower, upper : array broadcastable to (T, K)
        Bounds of the values.
    tolerance : array broadcastable to (T, K)
        Allowed excess over a bound.
    scale : array broadcastable to (T, K), optional
        Divisor of the margins in `share`, in the unit of the check. By default half the distance between the bounds or,
        if only one bound is finite, the absolute value of this bound.

    Examples
    --------
    >>> found = Judgement(places=("knee",), value=[[10.0], [-20.0]], lower=-5.0, upper=150.0)
    >>> found.violated.ravel()
    array([False,  True])
    """

    places: Sequence[str]
    value: Array
    lower: Array | float = -np.inf
    upper: Array | float = np.inf
    tolerance: Array | float = 0.0
    scale: Array | float | None = None

    def __post_init__(self) -> None:
        value = np.asarray(self.value, dtype=np.float64)
        value = value[:, None] if value.ndim == 1 else value
        if value.ndim != 2 or value.shape[1] != len(self.places):
            expected = f"one row per frame and {len(self.places)} columns"
            raise refusal("judge", "value", f"shape {value.shape}", expected, "return one column per place")
        object.__setattr__(self, "places", tuple(self.places))
        object.__setattr__(self, "value", value)
        for name in ("lower", "upper", "tolerance"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.float64))

    @property
    def low(self) -> Array:
        """Lower bounds (T, K), including the tolerance."""
        return np.broadcast_to(self.lower - self.tolerance, self.value.shape)

    @property
    def high(self) -> Array:
        """Upper bounds (T, K), including the tolerance."""
        return np.broadcast_to(self.upper + self.tolerance, self.value.shape)

    @cached_property
    def margin(self) -> Array:
        """Distance (T, K) of values from the nearest bound, including tolerance: negative outside, NaN if undecided."""
        low, high = self.lower - self.tolerance, self.upper + self.tolerance
        with np.errstate(invalid="ignore"):  # an infinite value has no distance from an infinite bound
            nearer = np.fmin(self.value - low, high - self.value)
        return np.where(np.isnan(low) | np.isnan(high), np.nan, nearer)

    @property
    def violated(self) -> NDArray[np.bool_]:
        """Whether each value is outside its bounds by more than the tolerance (T, K); False if it is undecided."""
        return np.asarray(self.margin < 0)

    @property
    def share(self) -> Array:
        """Margins (T, K) divided by `scale`, by default half the range: 1 in the middle, negative outside."""
        if self.scale is not None:
            return np.asarray(self.margin / self.scale)
        lower, upper = np.asarray(self.lower), np.asarray(self.upper)
        with np.errstate(invalid="ignore"):
            half = (upper - lower) / 2
        bounded = np.isfinite(half) & (half > 0)
        size = np.abs(np.where(np.isfinite(lower), lower, upper))
        scale = np.select([bounded, np.isfinite(size) & (size > 0)], [half, size], 1.0)
        return np.asarray(self.margin / scale)

    @classmethod
    def stacked(cls, parts: Sequence[Judgement]) -> Judgement:
        """Join the columns of several judgements of the same frames into one judgement."""
        names = ["value", "lower", "upper", "tolerance"] + ["scale"] * (parts[0].scale is not None)
        columns = {
            name: np.concatenate(
                [np.broadcast_to(getattr(one, name), one.value.shape) for one in parts], axis=1
            )
            for name in names
        }
        return cls([place for one in parts for place in one.places], **columns)


@runtime_checkable
class Check(Protocol):
    """Protocol of a check; the module has an example. The docstring of a check is the message of its findings."""

    @property
    def name(self) -> str:
        """Name in reports and in ``--checks``: ``joint-range``."""

    @property
    def unit(self) -> str:
        """Unit of the check's values: ``m``, ``deg``, ``m/s``, ``frames``, ``1``."""

    @property
    def reads(self) -> Sequence[str]:
        """Data of a body that the check needs: names from `READABLE`."""

    def judge(self, body: Body) -> Judgement:
        """Judge all frames of a body; raise `NotAskedError` if the check does not apply to this body."""


@dataclass(frozen=True, eq=False)
class FunctionCheck:
    """A check that consists of a function; the decorator `check` returns it.

    Parameters
    ----------
    name, unit, reads, points
        As in `Check`.
    function : callable
        Function from `Body` to `Judgement`; its keyword-only parameters are thresholds with defaults.
    over_time : bool
        Whether the check judges motion. In checks of motion a frame without a value does not count as undecided.
    thresholds : mapping
        Values of the thresholds that differ from the defaults, by name.
    """

    name: str
    unit: str
    reads: Sequence[str]
    function: Callable[..., Judgement]
    points: Sequence[str] = ()
    over_time: bool = False
    thresholds: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "__doc__", self.function.__doc__)

    @property
    def defaults(self) -> dict[str, Any]:
        """Default values of the thresholds, by name."""
        known = inspect.signature(self.function).parameters.values()
        return {one.name: one.default for one in known if one.kind is one.KEYWORD_ONLY}

    def with_thresholds(self, **thresholds: Any) -> FunctionCheck:
        """Return a copy of the check with the given thresholds."""
        return replace(self, thresholds={**self.thresholds, **thresholds})

    def judge(self, body: Body) -> Judgement:
        """Judge all frames of a body."""
        return self.function(body, **self.thresholds)


def check(
    name: str,
    *,
    unit: str,
    reads: Sequence[str] = ("joints",),
    points: Sequence[str] = (),
    over_time: bool = False,
) -> Callable[[Callable[..., Judgement]], FunctionCheck]:
    """Return a decorator that makes a check from a function which judges a `Body`.

    Parameters
    ----------
    name, unit, reads
        As in `Check`.
    points : sequence of str
        Names of the points that the check reads; needed only if they are few.
    over_time : bool
        Whether the check judges motion.

    Examples
    --------
    >>> import numpy as np, posekit
    >>> from posekit.validators import Judgement
    >>> @posekit.check("wrists-apart", unit="m", points=("right_wrist", "left_wrist"))
    ... def wrists_apart(body):
    ...     "The wrists are nearer than 5 cm."
    ...     return Judgement(["wrists"], np.linalg.norm(body.joints[:, 8] - body.joints[:, 9], axis=1), lower=0.05)
    >>> wrists_apart.name
    'wrists-apart'
    """
    return lambda judge: FunctionCheck(name, unit, tuple(reads), judge, tuple(points), over_time)


def message_of(one: Check) -> str:
    """Return the first sentence of a check's docstring."""
    return (inspect.getdoc(one) or one.name).split("\n\n")[0].replace("\n", " ").rstrip(".")


def judged(one: Check, body: Body) -> Judgement:
    """Apply a check to a body and verify its result.

    Raises
    ------
    NotAskedError
        If the check does not apply.
    InputError
        If the check raises another error, or does not return a `Judgement` with one row for each frame.
    """
    for name in one.reads:
        if not body.knows(name):
            raise NotAskedError(READABLE[name])
    try:
        found = one.judge(body)
    except PosekitError:
        raise
    except Exception as error:  # a user's code may raise anything: the message names the check and the line
        place = traceback.extract_tb(error.__traceback__)[-1]
        got = f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})"
        raise refusal(f"check {one.name}", "judge", got, "a Judgement", "correct the check") from error
    if not isinstance(found, Judgement) or len(found.value) != len(body):
        got = f"{len(found.value)} rows" if isinstance(found, Judgement) else type(found).__name__
        raise refusal(
            f"check {one.name}", "judge", got, f"a Judgement of {len(body)} rows", "return one row per frame"
        )
    return found


def find_check(given: Any, known: Mapping[str, Any]) -> Any:
    """Return the check that a name or an object stands for.

    Parameters
    ----------
    given : str or Check
        A check, a name in `known`, the name of an entry point, or ``module:Name``. The module may be in the current
        folder.
    known : mapping
        Built-in checks by name.

    Raises
    ------
    InputError
        If there is no such check, or the object lacks a member of `Check` or has a wrong member.
    """
    found = _named(given, known) if isinstance(given, str) else given
    found = found() if isinstance(found, type) else found
    what = getattr(found, "name", None) or type(found).__name__
    if not isinstance(found, Check):
        got = [f"no {name}" for name in ("name", "unit", "reads", "judge") if not hasattr(found, name)]
        remedy = "make it with @posekit.check"
        raise refusal("checks", str(what), ", ".join(got), "name, unit, reads and judge", remedy)
    if not CHECK_NAME.fullmatch(found.name):
        raise refusal(
            "checks", "name", repr(cut(found.name)), "lower-case words joined by -", "rename the check"
        )
    if wrong := [name for name in found.reads if name not in READABLE]:
        raise refusal(
            "checks", f"{what}: reads", repr(wrong[0]), f"some of {', '.join(READABLE)}", "correct it"
        )
    return found


def _named(given: str, known: Mapping[str, Any]) -> Any:
    """Return the check, or its class, with the given name. Modules in the current folder are searched first."""
    name = given if ":" in given else given.replace("_", "-")
    if name in known:
        return known[name]
    from importlib.metadata import EntryPoint, entry_points

    entries = entry_points(group=ENTRY_POINTS)
    if name not in entries.names and ":" not in given:
        names = (*known, *sorted(entries.names))
        raise refusal("checks", "", repr(cut(given)), "a check", nearest(given, names))
    entry = entries[name] if name in entries.names else EntryPoint(given, given, ENTRY_POINTS)
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        return entry.load()
    except (ImportError, AttributeError) as error:
        got, remedy = cut(given), f"it cannot be imported ({error})"
        raise refusal("checks", "", got, "a module and a name in it", remedy) from None
    finally:
        sys.path.remove(here)
