"""From postures, of any number, to a report of verdicts: in batches, with bounded memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.figure import Figure, load_figure
from posekit.files import Judged, Postures, Report, Result
from posekit.files.postures_q import Configurations
from posekit.files.report import Finding, PostureReport, Worst, make_report
from posekit.files.report_columns import PER_DEGREE, Columns, Place, joined
from posekit.files.report_schema import VERDICTS
from posekit.pipeline.tolerance import EXACT, MEASURED
from posekit.robot.scaling import segment_lengths, shoulders_are_behind
from posekit.tree import Findings
from posekit.validators import Judgement, Validator
from posekit.validators import Report as Verdicts
from posekit.validators.robot import Contacts

BATCH: Final = 4096
"""Postures that are judged at once."""

LISTED: Final = 10_000
"""Postures that a report lists one by one: all of a file that has no more, else the first that are not valid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Given:
    """What is to be judged: postures, or configurations in the validator's order."""

    joints: NDArray[np.float64] | None
    head: NDArray[np.float64] | None
    q: NDArray[np.float64] | None
    sequence: NDArray[np.intp] | None

    def __len__(self) -> int:
        return len(self.q) if self.q is not None else len(self.joints) if self.joints is not None else 0


def validate(
    validator: Validator,
    postures: Postures | Configurations,
    *,
    settings: dict[str, Any] | None = None,
    every: bool = False,
    sequence: NDArray[np.intp] | None = None,
    distances: bool | None = None,
) -> Report:
    """Judge a file of postures.

    Parameters
    ----------
    validator : Validator
    postures : Postures or Configurations
    settings : dict, optional
        What decided the verdicts, to be written with them.
    every : bool
        List every finding, not only violations and each check's worst.
    sequence : int array (N,), optional
        Which sequence in time each posture belongs to: see `Validator.check`.
    distances : bool, optional
        Whether to measure the nearest pair of bodies of every posture of a robot; by default where none is a mesh.

    Returns
    -------
    posekit.files.Report
    """
    if isinstance(postures, Configurations):
        given = _Given(
            joints=None, head=None, q=postures.in_order_of(validator.configuration_names), sequence=None
        )
    else:
        given = _Given(joints=postures.joints, head=postures.head, q=None, sequence=sequence)
    places: dict[Place, int] = {}
    parts: list[Columns] = []
    listed: list[PostureReport] = []
    all_listed = len(given) <= LISTED
    for first, verdicts in _batches(validator, given):
        contacts = _contacts(verdicts, distances)
        columns = _columns(verdicts, contacts, places)
        parts.append(columns)
        rows = (
            np.arange(len(columns)) if all_listed else np.flatnonzero(columns.verdict)[: LISTED - len(listed)]
        )
        listed += _list(
            verdicts, contacts, columns, list(places), rows, every=every, first=None if all_listed else first
        )
    checks = [name.replace("-", "_") for name in validator.checks]
    columns = joined(parts, list(places), [name for name in checks if _applies(name, given)])
    not_valid = len(columns) - columns.summary["valid"]
    return Report(
        settings={**validator.describe(), **_lengths_of(validator, given), **(settings or {})},
        postures=tuple(listed),
        checks=columns.by_check(),
        listed=None if all_listed else f"the first {len(listed)} of {not_valid} that are not valid",
        verdicts=None if all_listed else columns.letters,
        columns=columns,
    )


def recovered_with(result: Result) -> tuple[Figure, float]:
    """Return the figure of a result, and the angle tolerance (degrees) that its frames were judged with.

    Both are in its settings; a result without them is taken as the built-in figure's, and exact.
    """
    figure, settings = load_figure(), result.settings
    lengths = settings.get("lengths")
    if isinstance(lengths, dict) and settings.get("figure") != figure.hash:
        figure = figure.scaled({str(name): float(length) for name, length in lengths.items()})
    judged = settings.get("judged")
    kinds = set(judged) if isinstance(judged, list) else set()
    tolerances = [EXACT.angle]
    if "measured" in kinds:
        tolerances.append(MEASURED.angle)
    given = settings.get("tolerance")
    if "given" in kinds and isinstance(given, dict):
        tolerances.append(float(given.get("angle", EXACT.angle)))
    return figure, max(tolerances)


def _batches(validator: Validator, given: _Given) -> Iterator[tuple[int, Verdicts]]:
    """Judge batch by batch; the lengths are those of the whole file."""
    lengths = behind = None
    if given.joints is not None and validator.lengths == "median":
        lengths, behind = segment_lengths(given.joints), shoulders_are_behind(given.joints)
    for first in range(0, len(given), BATCH):
        rows = slice(first, first + BATCH)
        if given.q is not None:
            yield first, validator.check(q=given.q[rows])
        elif given.joints is not None:
            head = None if given.head is None else given.head[rows]
            which = None if given.sequence is None else given.sequence[rows]
            yield (
                first,
                validator.check(given.joints[rows], head, sequence=which, lengths=lengths, behind=behind),
            )


def _applies(check: str, given: _Given) -> bool:
    return given.q is None or check not in ("reach", "rigid_parts")


def _lengths_of(validator: Validator, given: _Given) -> dict[str, Any]:
    """Say whose lengths the model had."""
    if given.joints is None:
        return {"given": "configurations"}
    settings: dict[str, Any] = {"given": "joint positions", "lengths_from": validator.lengths}
    if validator.lengths == "median":
        lengths = segment_lengths(given.joints)
        settings["lengths"] = {name: round(length, 6) for name, length in lengths.items()}
    return settings


def _contacts(verdicts: Verdicts, distances: bool | None) -> Contacts | None:
    """Ask which bodies touch, of a robot; a figure's own check has said it pair by pair."""
    if not verdicts.colliders:
        return None
    if distances is None:
        distances = not any(collider.has_meshes for collider in verdicts.colliders)
    return verdicts.contacts(nearest=distances)


def _columns(verdicts: Verdicts, contacts: Contacts | None, places: dict[Place, int]) -> Columns:
    """Put the findings of a batch in columns; new places are added to those known."""
    n = len(verdicts.complete)
    worst_place, worst_margin, least = np.full(n, -1, dtype=np.int32), np.full(n, np.nan), np.full(n, np.inf)
    found: list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]] = []
    undecided: dict[str, int] = {}
    for judgement in verdicts.judgements:
        undecided[judgement.check] = int(
            np.count_nonzero(np.isnan(judgement.worst) & ~judgement.violated.any(axis=1))
        )
        if judgement.check == "collision" and contacts is not None:
            rows, margin = contacts.posture, contacts.distance - _lower(judgement)
            index = _indices(places, [Place("collision", name, "m") for name in contacts.names])[
                contacts.pair
            ]
            bad = contacts.violated
            found.append((rows[bad], index[bad], margin[bad]))
            _take_least(rows, index, margin, PER_DEGREE["m"], (worst_place, worst_margin, least))
            continue
        index = _indices(
            places,
            [
                Place(judgement.check, where, unit)
                for where, unit in zip(judgement.where, judgement.unit, strict=True)
            ],
        )
        rows, columns = np.nonzero(judgement.violated)
        found.append((rows, index[columns], judgement.margin[rows, columns]))
        each = np.array([PER_DEGREE.get(unit, 1.0) for unit in judgement.unit])
        scaled = np.where(np.isnan(judgement.margin), np.inf, judgement.margin / each)
        if scaled.shape[1]:
            column = scaled.argmin(axis=1)
            every = np.arange(n)
            _take_least(
                every,
                index[column],
                judgement.margin[every, column],
                each[column],
                (worst_place, worst_margin, least),
            )
    rows = np.concatenate([part[0] for part in found] or [np.zeros(0, dtype=np.int64)])
    order = np.argsort(rows, kind="stable")
    verdict = np.where(verdicts.invalid, 1, np.where(verdicts.valid, 0, 2)).astype(np.int8)
    return Columns(
        places=tuple(places),
        verdict=verdict,
        fk_distance=verdicts.fk_distance,
        worst_place=worst_place,
        worst_margin=worst_margin,
        posture=rows[order].astype(np.int64),
        place=np.concatenate([part[1] for part in found] or [np.zeros(0)])[order].astype(np.int32),
        margin=np.concatenate([part[2] for part in found] or [np.zeros(0)])[order],
        undecided=undecided,
    )


def _take_least(
    rows: NDArray[Any],
    place: NDArray[Any],
    margin: NDArray[Any],
    per_degree: Any,
    worst: tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Take over, in place, the margins that are smaller than the smallest so far; a row may be there more than once."""
    worst_place, worst_margin, least = worst
    scaled = np.where(np.isnan(margin), np.inf, margin / per_degree)
    order = np.argsort(-scaled, kind="stable")  # the smallest last, so that it stays
    order = order[scaled[order] < least[rows[order]]]
    at = rows[order]
    worst_place[at], worst_margin[at], least[at] = place[order], margin[order], scaled[order]


def _indices(places: dict[Place, int], new: list[Place]) -> NDArray[np.int32]:
    return np.array([places.setdefault(place, len(places)) for place in new], dtype=np.int32)


def _lower(judgement: Judgement) -> float:
    return float(judgement.lower.flat[0]) if judgement.lower.size else 0.0


def _list(
    verdicts: Verdicts,
    contacts: Contacts | None,
    columns: Columns,
    places: list[Place],
    rows: NDArray[Any],
    *,
    every: bool,
    first: int | None,
) -> list[PostureReport]:
    """List some postures of a batch; numbered where not all of the file are listed."""
    judged = [
        part
        for judgement in verdicts.judgements
        if judgement.check != "collision" or contacts is None
        for part in _judged(judgement, rows)
    ]
    made = make_report(
        settings={},
        verdicts=[VERDICTS[verdict] for verdict in columns.verdict[rows]],
        fk_distance=verdicts.fk_distance[rows],
        judged=judged,
        all_findings=every,
    )
    touching = _touching(verdicts, contacts, rows)
    robot = bool(verdicts.points)
    listed = []
    for row, posture in zip(rows.tolist(), made.postures, strict=True):
        place = int(columns.worst_place[row])
        worst = None
        if place >= 0:
            at = places[place]
            worst = Worst(
                check=at.check, where=at.where, margin=float(columns.worst_margin[row]), unit=at.unit
            )
        residual = dict(zip(verdicts.points, verdicts.residual[row].tolist(), strict=True)) if robot else None
        listed.append(
            PostureReport(
                verdict=posture.verdict,
                fk_distance=posture.fk_distance,
                findings=(*posture.findings, *touching.get(row, ())),
                index=None if first is None else first + row,
                worst=worst,
                residual=None
                if residual is None
                else {k: v if np.isfinite(v) else None for k, v in residual.items()},
            )
        )
    return listed


def _touching(verdicts: Verdicts, contacts: Contacts | None, rows: NDArray[Any]) -> dict[int, list[Finding]]:
    """List the pairs that collide, or are nearest, as findings of their postures."""
    findings: dict[int, list[Finding]] = {}
    if contacts is None:
        return findings
    judgement = next(one for one in verdicts.judgements if one.check == "collision")
    lower = _lower(judgement)
    wanted = set(rows.tolist())
    for row, pair, distance, bad in zip(
        contacts.posture.tolist(),
        contacts.pair.tolist(),
        contacts.distance.tolist(),
        contacts.violated.tolist(),
        strict=True,
    ):
        if row in wanted:
            findings.setdefault(row, []).append(
                Finding(
                    check="collision",
                    where=contacts.names[pair],
                    value=distance,
                    lower=lower,
                    upper=None,
                    margin=distance - lower,
                    unit="m",
                    verdict="invalid" if bad else "valid",
                )
            )
    return findings


def _judged(judgement: Judgement, rows: NDArray[Any]) -> list[Judged]:
    """Split a validator's findings by unit."""
    parts = []
    for unit in dict.fromkeys(judgement.unit):
        columns = [k for k, own in enumerate(judgement.unit) if own == unit]
        at = rows[:, None], np.array(columns)
        parts.append(
            Judged(
                check=judgement.check,
                unit=unit,
                where=[judgement.where[k] for k in columns],
                findings=Findings(
                    value=judgement.value[at],
                    lower=judgement.lower[at],
                    upper=judgement.upper[at],
                    rejects=judgement.violated[at],
                ),
                undecided=np.isnan(judgement.margin[at]),
            )
        )
    return parts
