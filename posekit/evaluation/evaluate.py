"""Comparison of one result with the true postures: joint errors, and calibration of probabilities and regions."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import View
from posekit.errors import refusal, shown
from posekit.evaluation.scores import MEASURES, correct_poses_score, posture_errors, reliability
from posekit.evaluation.truth import truth_of
from posekit.geometry import Array, Ints, Record, dot, mean_known, unit
from posekit.motion import Motion
from posekit.recovery import Recovery
from posekit.skeleton import PARENTS, TREE_SEGMENTS

if TYPE_CHECKING:
    import pandas

EVALUATION_SCHEMA: Final = "posekit.evaluation/2"

#: Postures whose errors are measured: the survivor with the smallest error, the most probable survivor, a random
#: survivor, the answer, and the first followed path.
ROLES: Final = ("best", "first", "random", "answer", "path")

#: Largest mean joint error of the best survivor at which the truth counts as retained, metres: for exact points and for
#: noisy points.
RETAINED_METRES: Final = (0.010, 0.035)

#: Distance to the truth to which `Recovery.answer.sure` refers, and depth difference of `nearer`, metres.
SURE_METRES: Final = 0.05

#: Columns that describe the condition of a frame.
KEYS: Final = ("clip", "yaw", "height", "noise")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Evaluation(Record):
    """Errors and other quantities of F frames, one column per quantity; errors are in metres.

    Parameters
    ----------
    columns : mapping of str to array (F,)
        ``frame``, ``time`` and ``survivors`` (their number). Errors are in columns ``{role}_{measure}``, for each
        posture of `ROLES` and each kind of error of `MEASURES`. ``branch`` is 1 if a survivor has the branch of the
        true posture, NaN if unknown. ``probability`` is that of the most probable survivor. ``sure`` is the stated
        probability of the answer, and ``sure_true`` whether all its joints are within 5 cm of the truth. ``regions`` is
        the share of joints of the best survivor whose 95 % region contains the true joint. ``nearer_true`` is the share
        of segments whose nearer end is stated correctly. ``reason`` states why a frame has no survivor. The columns of
        `KEYS` are optional.
    nearer_sure, nearer_true : array (F, 13)
        Stated probability of which end of each segment is nearer to the camera, and whether the statement is correct;
        NaN if unknown.
    settings : mapping
        Settings of the recovery and of the evaluation.

    Examples
    --------
    >>> import posekit
    >>> from posekit.evaluation import evaluate
    >>> view = posekit.builtin_view("seq1")
    >>> found = evaluate(posekit.recover(view), view.truth)
    >>> found.summary()["retained"]["10 mm"]
    1.0
    """

    columns: Mapping[str, NDArray[Any]]
    nearer_sure: Array
    nearer_true: Array
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.columns["frame"])

    def with_keys(self, **keys: Any) -> Evaluation:
        """Add columns that have the same value in all frames, such as the noise level."""
        columns = {name: np.full(len(self), value) for name, value in keys.items()} | dict(self.columns)
        return replace(self, columns=columns)

    @staticmethod
    def joined(parts: Sequence[Evaluation], settings: Mapping[str, Any]) -> Evaluation:
        """Concatenate the frames of evaluations that have the same columns."""
        return Evaluation(
            columns={name: np.concatenate([one.columns[name] for one in parts]) for name in parts[0].columns},
            nearer_sure=np.concatenate([one.nearer_sure for one in parts]),
            nearer_true=np.concatenate([one.nearer_true for one in parts]),
            settings=settings,
        )

    def conditions(self, keys: Sequence[str]) -> Iterator[tuple[dict[str, Any], Ints]]:
        """Yield each combination of values in the columns `keys`, and the frames that have these values."""
        values = list(zip(*(self.columns[key].tolist() for key in keys), strict=True)) or [()] * len(self)
        for one in sorted(set(values)):
            rows = np.flatnonzero([each == one for each in values])
            yield dict(zip(keys, one, strict=True)), rows

    def summary(self, rows: Ints | None = None) -> dict[str, Any]:
        """Summarise the given frames, or all frames: shares from 0 to 1, errors in millimetres.

        Shares refer to all frames, including frames without survivors. Errors are means, medians and 95th percentiles
        over frames with at least one survivor.
        """
        chosen = np.arange(len(self)) if rows is None else rows
        table = {name: values[chosen] for name, values in self.columns.items()}
        survivors, best = table["survivors"], table["best_mpjpe"]
        roles = [role for role in ROLES if np.isfinite(table[f"{role}_mpjpe"]).any()]
        near = np.where(np.isfinite(table["first_mpjpe"]), table["first_mpjpe"] <= RETAINED_METRES[1], np.nan)
        stated = {
            "first within 35 mm": (table["probability"], near),
            "sure": (table["sure"], table["sure_true"]),
            "nearer": (self.nearer_sure[chosen].ravel(), self.nearer_true[chosen].ravel()),
        }
        return {
            "frames": len(chosen),
            "without_survivor": int((survivors == 0).sum()),
            "retained": {f"{1000 * most:g} mm": float((best <= most).mean()) for most in RETAINED_METRES}
            | {"branch": _mean(table["branch"])},
            "survivors": {"median": float(np.median(survivors)), "p95": float(np.quantile(survivors, 0.95))},
            "error_mm": {
                role: {
                    measure: _spread(1000 * table[f"{role}_{measure}"])
                    for measure in MEASURES
                    if np.isfinite(table[f"{role}_{measure}"]).any()
                }
                for role in roles
            },
            "cps_mm": {role: correct_poses_score(table[f"{role}_worst_pa"]) for role in roles},
            "regions": _mean(table["regions"]),
            "nearer_true": _mean(table["nearer_true"]),
            "calibration": {name: reliability(*pair) for name, pair in stated.items()},
        }

    def table(self) -> str:
        """Return a Markdown table with one line for each noise level and each clip; errors are medians in mm."""
        head = (
            "|frames|empty|within 10 mm|within 35 mm|postures|PA best, mm|PA first, mm|PA answer, mm".split(
                "|"
            )
        )
        head += ["MPJPE answer, mm", "sure, ECE", "in 95 % regions"]
        rows = []
        keys = [key for key in ("noise", "clip") if key in self.columns]
        for key in keys or [""]:
            for named, chosen in self.conditions([key] if key else []):
                label = ", ".join(f"{v:g} px" if name == "noise" else str(v) for name, v in named.items())
                rows.append([label or "all", *_cells(self.summary(chosen))])
        note = ["", self.settings["truth"]] if "truth" in self.settings else []
        return "\n".join([_line(head), _line(["---"] * len(head)), *map(_line, rows), *note])

    def document(self) -> dict[str, Any]:
        """Return the content of the JSON file: settings, summaries of all frames and of each condition, every frame."""
        keys = [key for key in KEYS if key in self.columns]
        conditions = [{**name, **self.summary(rows)} for one in keys for name, rows in self.conditions([one])]
        rows = zip(*(values.tolist() for values in self.columns.values()), strict=True)
        frames = [dict(zip(self.columns, row, strict=True)) for row in rows]
        head = {"schema": EVALUATION_SCHEMA, "settings": dict(self.settings), "all": self.summary()}
        return {**head, "conditions": conditions, "frames": frames}

    def save(self, path: str | PathLike[str]) -> None:
        """Write a file: ``.json`` (all data), ``.csv`` (one row per frame, errors in metres) or ``.md`` (`table`).

        Raises
        ------
        InputError
            If the file name has another suffix, or the file cannot be written.
        """
        from posekit.files import write_bytes
        from posekit.formats.result_file import plain
        from posekit.formats.tables import csv_text

        target = Path(path)
        if target.suffix == ".json":
            text = json.dumps(plain(self.document()), indent=1)
        elif target.suffix == ".md":
            text = self.table()
        elif target.suffix == ".csv":
            text = csv_text(dict(self.columns)).rstrip()
        else:
            raise refusal(target, "", shown(target.suffix), "a name in .json, .csv or .md", "rename it")
        write_bytes(target, f"{text}\n".encode())

    def to_pandas(self) -> pandas.DataFrame:
        """Return the columns as a pandas data frame."""
        import pandas

        return pandas.DataFrame(dict(self.columns))


def evaluate(result: Recovery, truth: Array | View | Motion, *, seed: int = 0) -> Evaluation:
    """Compare every frame of a result with the true posture.

    Parameters
    ----------
    result : Recovery
        A result of F frames.
    truth : array (F, 14, 3), View or Motion
        True joints in the camera frame, metres, NaN if unknown; or a view with truth; or motion capture at the same
        times (`truth_of`). Errors of survivors exclude joints without image points.
    seed : int
        Seed for the choice of the random survivor.

    Raises
    ------
    InputError
        If the frames of truth and result differ, or the truth has no known joint.
    """
    count, rng = len(result), np.random.default_rng(seed)
    truth, note = truth_of(result, truth)
    found = result.survivors
    frame = np.asarray(found.frame)
    true = np.where(np.asarray(found.inferred)[..., None], np.nan, truth[frame])
    errors = _errors(result, found.joints, true)
    measured = {role: np.full((count, len(MEASURES)), np.nan) for role in ROLES}
    nearest, probability = np.full(count, -1), np.full(count, np.nan)
    survivors = np.bincount(frame, minlength=count)
    for k in np.flatnonzero(survivors).tolist():
        own = result.rows(k)
        measured["best"][k] = np.fmin.reduce(errors[own], axis=0)
        measured["first"][k] = errors[own.start]
        measured["random"][k] = errors[own.start + rng.integers(survivors[k])]
        probability[k] = np.asarray(found.probability)[own.start]
        if np.isfinite(errors[own, 0]).any():
            nearest[k] = own.start + np.nanargmin(errors[own, 0])
    measured["answer"] = _errors(result, result.answer.joints, truth)
    if result.path is not None and len(result.path):
        measured["path"] = _errors(result, result.path.joints[0], truth)
    nearer_sure, nearer_true = _nearer(result, truth)
    columns: dict[str, NDArray[Any]] = {
        "frame": np.arange(count),
        "time": np.asarray(result.frames.time),
        "survivors": survivors,
        **{f"{role}_{measure}": measured[role][:, k] for role in ROLES for k, measure in enumerate(MEASURES)},
        "branch": _branch_retained(result, truth),
        "probability": probability,
        "sure": np.asarray(result.answer.sure, dtype=np.float64),
        "sure_true": _sure_true(result, truth),
        "regions": _regions(result, truth, nearest),
        "nearer_true": mean_known(nearer_true),
        "reason": np.array(result.frames.reason, dtype=object),
    }
    settings = {**result.settings, **({"truth": note} if note else {})}
    return Evaluation(columns=columns, nearer_sure=nearer_sure, nearer_true=nearer_true, settings=settings)


def _errors(result: Recovery, joints: Array, truth: Array) -> Array:
    """Return `posture_errors`; for a scaled orthographic camera, ``mpjpe`` is after alignment of mean positions."""
    errors = posture_errors(joints, truth)
    if result.camera.get("model") == "scaled-orthographic":
        errors[:, MEASURES.index("mpjpe")] = errors[:, MEASURES.index("centred")]
        errors[:, MEASURES.index("worst")] = np.nan
    return errors


def true_branch(truth: Array) -> list[str]:
    """Return the branch of each true posture (N, 14, 3), given in the frame of a perspective camera.

    The digit of a joint is ``1`` (far) if it is beyond the point of its ray that is closest to the parent joint. The
    branch is empty if a joint is unknown.
    """
    rays = unit(truth)
    far = dot(truth[:, 1:] - truth[:, PARENTS[1:]], rays[:, 1:]) > 0
    known = np.asarray(np.isfinite(truth).all(axis=(1, 2)))
    return ["".join("01"[int(bit)] for bit in row) if ok else "" for row, ok in zip(far, known, strict=True)]


def _branch_retained(result: Recovery, truth: Array) -> Array:
    """Return whether a survivor has the branch of the true posture (F,); NaN if image points are not exact."""
    codes = np.asarray(result.survivors.branch)
    exact = np.array([bool(levels) for levels in result.frames.levels], dtype=bool)
    if not exact.any() or result.camera.get("model") == "scaled-orthographic":
        return np.full(len(result), np.nan)
    found = np.full(len(result), np.nan)
    for k, code in enumerate(true_branch(truth)):
        if code and exact[k]:
            found[k] = (codes[result.rows(k)] == code).any()
    return found


def _sure_true(result: Recovery, truth: Array) -> Array:
    """Return whether every joint of the answer is within 5 cm of the truth (F,); NaN if the truth is unknown."""
    away = result.answer.joints - truth
    relative = np.array(["relative" in of for of in result.answer.sure_of], dtype=bool)
    away[relative] -= away[relative, :1]
    distance = np.linalg.norm(away, axis=-1)
    known = np.isfinite(distance)
    inside = (np.where(known, distance, 0.0) <= SURE_METRES).all(axis=1)
    return np.where(known.any(axis=1), inside, np.nan)


def _regions(result: Recovery, truth: Array, nearest: Ints) -> Array:
    """Return the share of joints of each frame's best survivor whose 95 % region contains the true joint (F,)."""
    found = np.full(len(result), np.nan)
    chosen = np.flatnonzero(nearest >= 0)
    joints = result.survivors.joints[nearest[chosen]]
    radius = np.asarray(result.survivors.radius)[nearest[chosen]]
    away = joints - truth[chosen]
    if result.camera.get("model") == "scaled-orthographic":  # the camera determines no depth
        away -= np.nanmean(away, axis=1, keepdims=True)
    distance = np.linalg.norm(away, axis=-1)
    inside = np.where(np.isfinite(distance) & (radius > 0), distance <= radius, np.nan)
    found[chosen] = mean_known(inside)
    return found


def _nearer(result: Recovery, truth: Array) -> tuple[Array, Array]:
    """Return the probability of each segment's stated nearer end, and whether this end is correct: each (F, 13)."""
    start, end = np.array(TREE_SEGMENTS).T
    deeper = truth[:, end, 2] - truth[:, start, 2]
    true = np.where(deeper > SURE_METRES, -1, np.where(deeper < -SURE_METRES, 1, 0))
    sure = np.asarray(result.answer.nearer_sure, dtype=np.float64)
    known = np.isfinite(deeper) & np.isfinite(sure)
    right = np.where(known, np.asarray(result.answer.nearer) == true, np.nan)
    return sure, right


def _mean(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else None


def _spread(values: Array) -> dict[str, float]:
    known = values[np.isfinite(values)]
    median, most = np.quantile(known, (0.5, 0.95))
    return {"mean": float(known.mean()), "median": float(median), "p95": float(most)}


def _cells(found: Mapping[str, Any]) -> list[str]:
    """Return the cells of one row of the Markdown table."""
    errors = found["error_mm"]
    pa = [errors.get(role, {}).get("pa", {}).get("median") for role in ("best", "first", "answer")]
    sure = found["calibration"]["sure"]
    return [
        str(found["frames"]),
        f"{found['without_survivor'] / found['frames']:.1%}",
        *(f"{found['retained'][key]:.1%}" for key in ("10 mm", "35 mm")),
        f"{found['survivors']['median']:g}",
        *(_short(value) for value in pa),
        _short(errors.get("answer", {}).get("mpjpe", {}).get("median")),
        "-" if sure is None else f"{sure['ece']:.2f}",
        "-" if found["regions"] is None else f"{found['regions']:.1%}",
    ]


def _short(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}" if abs(value) < 10 else f"{value:.0f}"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
