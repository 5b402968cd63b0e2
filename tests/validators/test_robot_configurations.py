"""Verdicts on configurations are known before their margins: what is said first is what the margins say."""

import importlib
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.formats.own import write_report
from posekit.formats.own.postures_q import NamedConfigurations
from posekit.robots import Robot, load_robot
from posekit.validation import validate_postures
from posekit.validators import Validator
from posekit.validators.robot import Deferred

ROBOTS = ("stick_figure", "human", "simple_humanoid")
TOLERANCE = np.radians(1e-3)

TURNTABLE = """<robot name="turntable"><link name="a"/><link name="b"/>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>"""


@lru_cache
def validator(name: str) -> Validator:
    figure = name == "stick_figure"
    return Validator(None if figure else name, checks=("joint-range", "collision"), ranges="urdf")


@lru_cache
def some_q(name: str, count: int = 400) -> np.ndarray:
    """Return configurations around the limits, and within each joint's own at its edges, to the last bit."""
    robot = load_robot(name)
    lower, upper = robot.lower[7:], robot.upper[7:]
    rng = np.random.default_rng(7)
    q = np.tile(pin.neutral(robot.model), (count, 1))
    q[:, 7:] = rng.uniform(lower - 0.01, upper + 0.01, (count, len(lower)))
    some = count // 2
    q[:some, 7:] = np.clip(0.0, lower, upper)
    for k in range(some):
        joint = k % len(lower)
        over, under = upper[joint] + TOLERANCE, lower[joint] - TOLERANCE
        edges = (upper[joint], over, np.nextafter(over, 9.0), over * (1 + 1e-12), lower[joint], under)
        q[k, 7 + joint] = (*edges, np.nextafter(under, -9.0), np.nextafter(under, 9.0))[k // len(lower) % 8]
    return q


@pytest.mark.parametrize("name", ROBOTS)
def test_verdicts_are_those_of_the_margins(name: str) -> None:
    q = some_q(name)
    report = validator(name).check(q=q)
    first, judgements = report.invalid.copy(), report.judgements
    assert isinstance(judgements, Deferred)
    later = np.logical_or.reduce([one.violated.any(axis=1) for one in judgements])
    assert np.array_equal(first, later)
    assert 0.1 < first.mean() < 0.9
    written_out = replace(report, judgements=list(judgements))
    assert written_out.verdicts == report.verdicts
    assert np.array_equal(written_out.valid, report.valid)
    assert np.array_equal(written_out.undecided, report.undecided)


@pytest.mark.parametrize("name", ROBOTS)
def test_verdicts_are_those_of_one_configuration_at_a_time(name: str) -> None:
    q = some_q(name)[::20]
    assert validator(name).check(q=q).verdicts == [
        validator(name).check(q=one[None]).verdicts[0] for one in q
    ]


def test_verdicts_alone_make_no_judgement_and_each_is_made_once() -> None:
    made = []

    def maker(rows: object) -> object:
        made.append(rows)
        return object()

    judgements = Deferred([maker, maker], np.zeros(3, dtype=bool))  # type: ignore[list-item]
    assert len(judgements) == 2
    assert not made
    assert judgements[0] is judgements[0]
    assert len(made) == 1
    assert judgements[-1] is judgements[1]
    assert [judgements[0], judgements[1]] == list(judgements) == judgements[:]
    assert len(made) == 2
    with pytest.raises(IndexError):
        _ = judgements[2]


@pytest.mark.parametrize("name", ROBOTS)
def test_judgements_of_some_are_rows_of_the_judgements_of_all(name: str) -> None:
    judgements = validator(name).check(q=some_q(name)).judgements
    assert isinstance(judgements, Deferred)
    rows = np.flatnonzero(judgements.rejected)[::3]
    for part, whole in zip(judgements.of(rows), judgements, strict=True):
        assert (part.check, part.where, part.unit) == (whole.check, whole.where, whole.unit)
        for field in ("value", "lower", "upper", "margin", "violated"):
            assert np.array_equal(getattr(part, field), getattr(whole, field)[rows])


def test_what_is_left_out_of_a_report_rejects_nothing() -> None:
    report = validator("human").check(q=some_q("human"))
    limits_alone = replace(report, judgements=[report.judgements[0]])
    assert np.array_equal(limits_alone.invalid, report.judgements[0].violated.any(axis=1))
    assert limits_alone.invalid.sum() < report.invalid.sum()


def test_configurations_cannot_change_under_their_verdicts() -> None:
    q = some_q("human")[:3].copy()
    report = validator("human").check(q=q)
    q[:] = 0.0
    assert np.array_equal(report.q, some_q("human")[:3])
    with pytest.raises(ValueError, match="read-only"):
        report.q[0, 0] = 1.0


@pytest.mark.parametrize("name", ROBOTS)
def test_contacts_are_all_pairs_one_by_one_and_the_nearest_of_the_rest(name: str) -> None:
    q = some_q(name)[::8]
    report = validator(name).check(q=q)
    [collider] = report.colliders
    geometry, model = collider.subject.geometry, collider.subject.model
    assert geometry is not None
    data, geometry_data = model.createData(), geometry.createData()
    for request, margin in zip(geometry_data.collisionRequests, collider.margins.tolist(), strict=True):
        request.security_margin = margin
    contacts = report.contacts(nearest=True)
    for row, one in enumerate(q):
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, one)
        pairs = range(len(geometry.collisionPairs))
        hits = [k for k in pairs if pin.computeCollision(geometry, geometry_data, k)]
        apart = [pin.computeDistance(geometry, geometry_data, k).min_distance for k in pairs]
        mine = contacts.posture == row
        assert contacts.pair[mine].tolist() == (hits or [int(np.argmin(apart))])
        assert np.allclose(contacts.distance[mine], [apart[k] for k in contacts.pair[mine]], atol=1e-12)
        assert contacts.violated[mine].tolist() == [bool(hits)] * max(1, len(hits))
    some = np.arange(len(q)) % 2 == 0
    half = report.contacts(nearest=some)
    kept = contacts.violated | some[contacts.posture]
    assert np.array_equal(half.posture, contacts.posture[kept])
    assert np.array_equal(half.distance, contacts.distance[kept])


def test_less_detail_says_the_same_of_what_is_not_valid(tmp_path: Path) -> None:
    given = NamedConfigurations(q=some_q("human"))
    reports = {
        detail: validate_postures(validator("human"), given, detail=detail)
        for detail in ("findings", "margins", "verdicts")
    }
    whole = reports["findings"]
    for detail, report in reports.items():
        assert report.summary == whole.summary, detail
        assert report.checks == whole.checks, detail
        assert report.settings == whole.settings, detail
        write_report(tmp_path / f"{detail}.md", report)
    assert len(whole.postures) == len(given)
    assert not reports["margins"].postures
    texts = [(tmp_path / f"{detail}.md").read_bytes() for detail in reports]
    assert texts[0] == texts[1] == texts[2]
    write_report(tmp_path / "whole.csv", whole)
    write_report(tmp_path / "margins.csv", reports["margins"])
    assert (tmp_path / "whole.csv").read_bytes() == (tmp_path / "margins.csv").read_bytes()


def test_parts_of_a_file_are_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    given = NamedConfigurations(q=some_q("human"))
    module = importlib.import_module("posekit.validation.batches")
    whole = validate_postures(validator("human"), given, detail="verdicts").columns
    monkeypatch.setattr(module, "POSTURES_AT_ONCE", 17)
    parts = validate_postures(validator("human"), given, detail="verdicts").columns
    assert whole is not None
    assert parts is not None
    assert whole.places == parts.places or set(whole.places) == set(parts.places)
    for a, b in pairwise((whole, parts)):
        assert np.array_equal(a.verdict, b.verdict)
        assert np.array_equal(a.posture, b.posture)
        assert [a.places[k] for k in a.place] == [b.places[k] for k in b.place]
        assert np.array_equal(a.margin, b.margin)


def test_an_order_of_ones_own_is_brought_into_the_robots() -> None:
    q, robot = some_q("human")[:40], load_robot("human")
    names = robot.configuration_names
    turned = NamedConfigurations(q=q[:, ::-1], names=names[::-1])
    plain = validate_postures(validator("human"), NamedConfigurations(q=q, names=names), detail="verdicts")
    assert validate_postures(validator("human"), turned, detail="verdicts").verdicts == plain.verdicts


def test_a_robot_without_limits_is_inside_them() -> None:
    robot = Robot(urdf=TURNTABLE)
    judge = Validator(robot, checks=("joint-range",))
    q = pin.neutral(robot.model)[None]
    assert judge.check(q=q).verdicts == ["valid"]
    assert judge.check(q=q).judgements[0].where == ()
    report = validate_postures(judge, NamedConfigurations(q=q))
    assert [posture.verdict for posture in report.postures] == ["valid"]


def test_no_configurations_are_no_verdicts() -> None:
    assert validator("human").check(q=np.zeros((0, 43))).verdicts == []
