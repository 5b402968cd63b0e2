"""`Recovery`: all survivors and the answer of each frame, and the number of rejected branches by reason."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from posekit.body import with_head
from posekit.errors import InputError, refusal, shown
from posekit.geometry import Array, Record, read_only
from posekit.motion import Motion
from posekit.skeleton import HEAD_POINTS, JOINTS, TREE_SEGMENTS
from posekit.validators.report import plural

if TYPE_CHECKING:
    from os import PathLike

    import pandas


def column(*shape: int, fill: Any = np.nan) -> Any:
    """Declare an array column of a `Table` by the shape of one row and the default value."""
    return field(default=None, metadata={"shape": shape, "fill": fill})


def listed(fill: Any) -> Any:
    """Declare a column of a `Table` that is a sequence with one entry per row, and the default entry."""
    return field(default=(), metadata={"entry": fill})


class Table(Record):
    """Base class of read-only tables of survivors, frames, answers or paths; the first column is required."""

    def __post_init__(self) -> None:
        rows = len(self)
        for one in fields(self):  # type: ignore[arg-type]
            if "entry" in one.metadata:
                self._set(one.name, tuple(getattr(self, one.name)) or (one.metadata["entry"],) * rows)
            elif "shape" in one.metadata:
                given = getattr(self, one.name)
                shape, fill = (rows, *one.metadata["shape"]), one.metadata["fill"]
                dtype = np.dtype(np.str_) if isinstance(fill, str) else np.result_type(type(fill))
                # A read-only array need not be copied.
                copy = None if isinstance(given, np.ndarray) and not given.flags.writeable else True
                values = np.full(shape, fill) if given is None else np.array(given, dtype, copy=copy)
                if values.shape != shape and not (values.size == 0 and rows == 0):
                    raise InputError(
                        f"result: {one.name}: got shape {values.shape}; expected {shape}; correct it"
                    )
                self._set(one.name, values.reshape(shape))

    def __len__(self) -> int:
        """Count the rows."""
        return len(getattr(self, fields(self)[0].name))  # type: ignore[arg-type]

    def columns(self) -> dict[str, Any]:
        """Return all columns by name, except columns that are computed at first access."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.metadata}  # type: ignore[arg-type]


class Derived:
    """A field that may be set to a function without arguments; the function computes the value at first access."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, table: Any, owner: type | None = None) -> Any:
        held = {} if table is None else vars(table)
        if callable(held.get(self.name)):
            self.__set__(table, held[self.name]())
        return held.get(self.name)

    def __set__(self, table: Any, value: Any) -> None:
        given = {} if value is None else value
        vars(table)[self.name] = read_only(given) if isinstance(given, np.ndarray) else given


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Survivors(Table):
    """N postures of all frames that passed every check, sorted by frame and then by decreasing probability.

    Parameters
    ----------
    frame : int array (N,)
        Frame of each survivor, counted from 0.
    joints : array (N, 14, 3)
        Joint positions, metres, camera frame; NaN if a joint is unknown.
    head : array (N, 5, 3), optional
        Head points, metres, camera frame; unseen points are NaN.
    q : array (N, nq)
        Configuration of each survivor.
    probability : array (N,), optional
        Probability of each survivor; within a frame the sum is one minus `Frames.unlisted_probability`.
    chi2 : array (N,), optional
        Chi-square of the residuals under noise; 0 in exact frames.
    margins : mapping of str to array (N,)
        Worst margin of each survivor by check, in the check's unit; NaN if the check is undecided.
    branch : str array (N,), optional
        Near-far code of an exact posture: 0 (near) or 1 (far) for each joint from the second; empty under noise.
    group : int array (N,), optional
        Group of similar postures within the frame; -1 if no groups were requested.
    radius : array (N, 14), optional
        Radius (metres) within which each joint lies with 95 % probability if the posture is right; 0 in exact frames.
    inferred : bool array (N, 14), optional
        True for joints that the image does not show.
    scale : array (N,), optional
        Scale of a scaled orthographic camera, pixels per metre; NaN for other cameras.
    """

    frame: NDArray[np.intp] = column(fill=0)
    joints: Array = column(len(JOINTS), 3)
    q: Derived = Derived()
    head: Array = column(len(HEAD_POINTS), 3)
    probability: Array = column()
    chi2: Array = column(fill=0.0)
    margins: Derived = Derived()
    branch: NDArray[np.str_] = column(fill="")
    group: NDArray[np.intp] = column(fill=-1)
    radius: Array = column(len(JOINTS), fill=0.0)
    inferred: NDArray[np.bool_] = column(len(JOINTS), fill=False)
    scale: Array = column()

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Survivors:
        """Return the selected rows."""
        return Survivors(**self._columns(rows))

    def _columns(self, rows: NDArray[np.intp] | NDArray[np.bool_] | slice) -> dict[str, Any]:
        """Return the selected rows of every column."""
        return {name: values[rows] for name, values in self.columns().items()} | {
            "q": lambda: self.q[rows],
            "margins": lambda: {name: values[rows] for name, values in self.margins.items()},
        }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Frames(Table):
    """Table of F frames: time, camera, rejected branches by reason, and why a frame has no survivors.

    Parameters
    ----------
    time : array (F,)
        Seconds; NaN if unknown.
    pictures : sequence of F str
        Names of the pictures; empty if there are none.
    camera : sequence of F mappings
        Facts about the camera: ``f``, ``rotation``, ``position``, ``residual``, ``scale``.
    rejected : sequence of F mappings
        Number of rejected branches by reason (``check/place``). In an exact frame, rejected branches and survivors
        together are 8192.
    levels : sequence of F sequences
        Number of branches that remain after each joint of the kinematic tree; empty if no branches were searched.
    unlisted : int array (F,), optional
        Number of postures that are not listed because they are too unlikely (setting `coverage`).
    unlisted_probability : array (F,), optional
        Total probability of the postures that are not listed.
    reason : sequence of F str
        Reason why a frame has no survivors; empty if it has survivors.
    root : sequence of F mappings or None
        How the neck's depth was found: ``method``, ``estimate`` and ``deviation`` (metres).
    judged : sequence of F str
        How a frame was judged: ``exact``, ``tolerated`` or ``noisy``.
    """

    time: Array = column()
    pictures: Sequence[str] = ()
    camera: Sequence[Mapping[str, Any]] = listed({})
    rejected: Sequence[Mapping[str, int]] = listed({})
    levels: Sequence[Sequence[int]] = listed(())
    unlisted: NDArray[np.intp] = column(fill=0)
    unlisted_probability: Array = column(fill=0.0)
    reason: Sequence[str] = listed("")
    root: Sequence[Mapping[str, Any] | None] = listed(None)
    judged: Sequence[str] = listed("")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Answer(Table):
    """One answer for each of F frames.

    Parameters
    ----------
    joints : array (F, 14, 3)
        Expected posture, moved to the nearest posture with the person's lengths; metres, camera frame; NaN if a frame
        has no survivor.
    sure : array (F,)
        Probability that every joint of the answer is within 5 cm of the person.
    sure_of : sequence of F str
        ``position``, or ``relative to the neck`` if the depth is not known; empty if there is no answer.
    survivor : int array (F,)
        Row of the survivor nearest to the answer; -1 if the frame has no survivor.
    representatives : sequence of F int arrays
        Rows of a few survivors. The postures within 5 cm of a representative in every joint have 95 % of the
        probability. The first representative represents the largest probability.
    represented : sequence of F arrays
        Total probability of the postures that each representative stands for: those within 5 cm of it, except postures
        within 5 cm of an earlier representative.
    nearer : int array (F, 13)
        Most probable depth order of each segment from a joint to its parent: 1 if the joint is nearer to the camera by
        more than 5 cm, -1 if it is farther by more than 5 cm, otherwise 0.
    nearer_sure : array (F, 13)
        Probability of `nearer`; NaN if there is no answer.
    """

    joints: Array = column(len(JOINTS), 3)
    sure: Array = column()
    sure_of: Sequence[str] = listed("")
    survivor: NDArray[np.intp] = column(fill=-1)
    representatives: Sequence[NDArray[np.intp]] = listed(np.empty(0, dtype=np.intp))
    represented: Sequence[Array] = listed(np.empty(0))
    nearer: NDArray[np.intp] = column(len(TREE_SEGMENTS), fill=0)
    nearer_sure: Array = column(len(TREE_SEGMENTS))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Paths(Table):
    """P paths through the F frames of a film, the likeliest first.

    Parameters
    ----------
    survivor : int array (P, F)
        Row of the survivor on the path in each frame; -1 if the path skips the frame.
    probability : array (P,)
        Probability of each path among all paths.
    joints : array (P, F, 14, 3)
        Smoothed positions, metres, camera frame; NaN before and after the path.
    """

    survivor: NDArray[np.intp]
    probability: Array
    joints: Array


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Frame(Survivors):
    """The survivors of one frame, with the frame's entries of `Frames` and `Answer` as attributes.

    Parameters
    ----------
    number : int
        Frame, from 0.
    picture : str
        Name of the picture; empty if there is none.
    answer : array (14, 3)
        Joints of the answer.
    """

    number: int
    time: float
    picture: str
    camera: Mapping[str, Any]
    rejected: Mapping[str, int]
    levels: Sequence[int]
    unlisted: int
    unlisted_probability: float
    reason: str
    root: Mapping[str, Any] | None
    judged: str
    answer: Array
    sure: float
    sure_of: str
    survivor: int
    representatives: NDArray[np.intp]
    represented: Array
    nearer: NDArray[np.intp]
    nearer_sure: Array

    def _facts(self) -> list[str]:
        return [f"frame {self.number}", plural(len(self), "posture")]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Recovery(Record):
    """Result of `posekit.recover`: every posture that fits a view and passes the checks.

    Parameters
    ----------
    survivors : Survivors
    frames : Frames
    answer : Answer
    path : Paths, optional
        Paths through the frames, if following was requested.
    settings : mapping
        Settings that the result depends on, as plain numbers, strings and lists.
    tolerances : mapping
        Tolerances of exact and tolerated frames, and the noise assumed in other frames.
    lengths : mapping of str to float
        Segment lengths of the person, metres.
    joint_names, configuration_names : sequence of str
        Names of the joints of `survivors.joints` and of the entries of `survivors.q`.
    unit : str
        Unit of length in files. All arrays are in metres.
    camera : mapping
        Fields of the view's camera, as in files.
    source : str
        File of the view; empty if there is none.

    Examples
    --------
    >>> import posekit
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"))
    >>> len(recovery), recovery[0].joints.shape[1:]
    (5, (14, 3))
    """

    survivors: Survivors
    frames: Frames
    answer: Derived = Derived()
    path: Paths | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    tolerances: Mapping[str, Any] = field(default_factory=dict)
    lengths: Mapping[str, float] = field(default_factory=dict)
    joint_names: Sequence[str] = JOINTS
    configuration_names: Sequence[str] = ()
    unit: str = "m"
    camera: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""

    def __len__(self) -> int:
        """Count the frames."""
        return len(self.frames)

    def __getitem__(self, k: int) -> Frame:
        """Return one frame; negative numbers count from the end."""
        k = operator.index(k)
        if not -len(self) <= k < len(self):
            raise IndexError(f"frame {k} of {len(self)}")
        number = k % len(self)
        entries: dict[str, Any] = {
            one.name: getattr(table, one.name)[number]
            for table in (self.frames, self.answer)
            for one in fields(table)
            if one.name not in ("pictures", "joints")
        }
        entries["picture"] = self.frames.pictures[number] if self.frames.pictures else ""
        columns = self.survivors._columns(self.rows(number))
        return Frame(number=number, answer=self.answer.joints[number], **entries, **columns)

    def __iter__(self) -> Iterator[Frame]:
        """Iterate over the frames."""
        return (self[k] for k in range(len(self)))

    def rows(self, k: int) -> slice:
        """Return the rows of the survivors of one frame."""
        return slice(int(self._starts[k]), int(self._starts[k + 1]))

    @cached_property
    def _starts(self) -> NDArray[np.intp]:
        return np.searchsorted(self.survivors.frame, np.arange(len(self) + 1))

    def _facts(self) -> list[str]:
        empty = int((np.diff(self._starts) == 0).sum())
        names = [plural(len(self), "frame"), plural(len(self.survivors), "posture")]
        return names + ([f"none in {empty}"] if empty else [])

    def motion(self, which: Literal["answer", "path", "all", "first"] = "answer") -> Motion:
        """Return the result as a motion, in the camera frame.

        Parameters
        ----------
        which : {"answer", "path", "all", "first"}
            ``answer``: the survivor nearest to the answer of each frame; ``path``: the most probable path; ``all``: all
            survivors, as alternative postures of their frames; ``first``: the most probable survivor of each frame. A
            path has smoothed joints and therefore no configurations.

        Raises
        ------
        InputError
            If `which` is unknown, if it is ``path`` and no path was followed, or if no frame has a posture.
        """
        self.refuse_empty()
        table, starts, time = self.survivors, self._starts, self.frames.time
        chosen = {
            "answer": self.answer.survivor,
            "first": np.where(np.diff(starts) > 0, starts[:-1], -1),
            "all": np.arange(len(table)),
        }
        shared: dict[str, Any] = {"up": "-y", "source": self.source, "unit": self.unit}
        if which == "path":
            if self.path is None or not len(self.path):
                raise refusal(self.source, "", "no followed path", "a path", "recover with follow")
            return Motion(joints=self.path.joints[0], time=time, **shared)
        if which not in chosen:
            expected = "answer, path, all or first"
            raise refusal(self.source or "result", "which", shown(which), expected, "choose one")
        # Row -1, the appended row of NaN, is used for frames without a posture.
        points, q = (
            np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])[chosen[which]]
            for values in (with_head(table.joints, table.head), table.q)
        )
        frame = table.frame if which == "all" else np.arange(len(self))
        return Motion(
            joints=points,
            joint_names=(*self.joint_names, *HEAD_POINTS),
            q=q,
            q_names=self.configuration_names,
            robot="figure",
            time=time[frame],
            frame=frame,
            **shared,
        )

    def refuse_empty(self) -> None:
        """Raise an `InputError` with the first frame's reason if no frame has a posture."""
        if not len(self.survivors):
            why = next(filter(None, self.frames.reason), "none passes the checks")
            raise refusal(self.source or "result", "", f"no posture: {why}", "one", "see recover --explain")

    def save(self, path: str | PathLike[str]) -> None:
        """Write the result: ``.json``, ``.json.gz``, ``.npz`` or ``.parquet``."""
        import posekit

        posekit.save(self, path)

    def to_pandas(self) -> pandas.DataFrame:
        """Return the survivors as a table: ``frame, time, probability, …, neck_x, …, q_0, …``."""
        import pandas

        table = self.survivors
        columns: dict[str, Any] = {"frame": table.frame, "time": self.frames.time[table.frame]}
        columns |= {name: values for name, values in table.columns().items() if values.ndim == 1}
        columns |= {f"margin_{name}": values for name, values in table.margins.items()}
        for j, joint in enumerate(self.joint_names):
            columns |= {f"{joint}_{axis}": table.joints[:, j, k] for k, axis in enumerate("xyz")}
            columns |= {f"{joint}_radius": table.radius[:, j], f"{joint}_inferred": table.inferred[:, j]}
        return pandas.DataFrame(columns | {f"q_{k}": values for k, values in enumerate(table.q.T)})
