"""The stick figure and the published human as judges of the same postures."""

from __future__ import annotations

import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.studies.two_models import reasons
from benchmarks.studies.two_models.angles import angles_of, excess, figure_limits, in_human_order, readings
from benchmarks.studies.two_models.human import (
    HELD_JOINTS,
    HUMAN_NAME,
    Counterpart,
    joint_columns,
    limits_of_human,
    limits_on_human,
    mapped_ranges,
    measure_counterparts,
    ranges_text,
    without_collision,
)
from benchmarks.studies.two_models.labelled import ILLEGAL_KINDS, Labelled, labelled_postures
from benchmarks.studies.two_models.reasons import CAPSULE_REASON, LONG_TRUNK, SEARCH_REASON, SPINE_ORDER
from posekit import Validator, load_figure
from posekit.body import Figure
from posekit.errors import InputError
from posekit.robots import load_robot
from posekit.robots.joint_map import find_joint_map
from posekit.robots.scaling import scaled
from posekit.skeleton import DOFS, JOINT, JOINTS
from posekit.synthesis import random_postures
from posekit.validators import Report


@pytest.fixture(scope="module")
def figure() -> Figure:
    return load_figure()


@pytest.fixture(scope="module")
def counterparts(figure: Figure) -> dict[str, Counterpart]:
    return measure_counterparts(figure)


@pytest.fixture(scope="module")
def held(
    figure: Figure, counterparts: dict[str, Counterpart], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The mapped ranges with a trunk that is rigid, as the stick figure's."""
    path = tmp_path_factory.mktemp("ranges") / "held.toml"
    limits = limits_on_human(figure_limits(figure), counterparts)
    path.write_text(ranges_text(limits | dict.fromkeys(HELD_JOINTS, (0.0, 0.0))), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def labelled(figure: Figure) -> Labelled:
    return labelled_postures(figure, 25, np.random.default_rng(3))


@pytest.fixture(scope="module")
def judged(figure: Figure, labelled: Labelled, held: Path) -> tuple[Report, Report]:
    human = Validator(HUMAN_NAME, ranges=str(held))
    return Validator(figure, ranges="urdf", strict=True).check(labelled.joints), human.check(
        labelled.joints, lengths=figure.lengths
    )


def configuration(figure: Figure, **angles: float) -> np.ndarray:
    """A configuration with bent elbows and knees, so that every angle shows, and some others, degrees."""
    q = pin.neutral(figure.model)
    bent = {dof: 60.0 for dof in DOFS if "elbow" in dof or "knee" in dof}
    for dof, angle in (bent | angles).items():
        q[figure.angle_index[DOFS.index(dof)]] = np.radians(angle)
    return np.asarray(q)


# The mapping.


def test_the_table_of_ranges_is_what_is_measured(
    figure: Figure, counterparts: dict[str, Counterpart]
) -> None:
    table = tomllib.loads(mapped_ranges().read_text(encoding="utf-8"))["limits"]
    measured = limits_on_human(figure_limits(figure), counterparts)
    assert set(table) == set(measured)
    for joint, limits in measured.items():
        assert table[joint] == pytest.approx(limits, abs=2e-3), joint


def test_every_angle_has_a_joint_of_its_own(counterparts: dict[str, Counterpart]) -> None:
    joints = [found.joint for found in counterparts.values()]
    assert len(set(joints)) == len(joints) == 19
    # Wu et al. 2005: Z flexes, X abducts, Y rotates.
    axes = {dof.split(".")[1]: found.joint[-1] for dof, found in counterparts.items()}
    assert axes == {"flexion": "Z", "bending": "X", "abduction": "X", "rotation": "Y"}


@pytest.mark.parametrize("turn", [-25.0, 35.0])
def test_the_human_reads_each_angle_as_the_table_says(
    figure: Figure, counterparts: dict[str, Counterpart], held: Path, turn: float
) -> None:
    dofs = [
        dof for dof in counterparts if figure_limits(figure)[dof][0] < turn < figure_limits(figure)[dof][1]
    ]
    q = np.array([configuration(figure, **{dof: turn}) for dof in dofs])
    human = Validator(HUMAN_NAME, ranges=str(held), checks=("reach", "joint-range"))
    report = human.check(figure.forward_kinematics(q)[:, : len(JOINTS)], lengths=figure.lengths)
    assert report.verdicts == ["valid"] * len(dofs)
    columns = joint_columns(human)
    for row, dof in enumerate(dofs):
        joint, sign, offset = counterparts[dof]
        assert np.degrees(report.q[row, columns[joint]]) == pytest.approx(sign * turn + offset, abs=0.01), dof


def test_limits_come_back(
    figure: Figure, judged: tuple[Report, Report], counterparts: dict[str, Counterpart]
) -> None:
    back = limits_of_human(judged[1], counterparts)
    for dof, limits in figure_limits(figure).items():
        assert back[dof] == pytest.approx(limits, abs=2e-3), dof


# Angles.


def test_all_readings_of_the_angles_place_the_points_alike(figure: Figure) -> None:
    q = random_postures(figure, 20, np.random.default_rng(0))
    wanted = figure.forward_kinematics(q)[:, : len(JOINTS)]
    dofs_of = {"pelvis": ("flexion", "bending", "rotation")}
    for part, ways in readings(angles_of(figure, q)).items():
        names = [f"pelvis.{name}" for name in dofs_of["pelvis"]]
        if part != "pelvis":
            hinge = part.replace("shoulder", "elbow").replace("hip", "knee")
            names = [f"{part}.{name}" for name in ("flexion", "abduction", "rotation")] + [f"{hinge}.flexion"]
        assert len(ways) == (2 if part == "pelvis" else 4)
        for way in ways:
            other = q.copy()
            other[:, [figure.angle_index[DOFS.index(name)] for name in names]] = np.radians(way)
            np.testing.assert_allclose(
                figure.forward_kinematics(other)[:, : len(JOINTS)], wanted, atol=1e-12, err_msg=part
            )


def test_legal_angles_are_not_outside_and_one_beyond_is(figure: Figure) -> None:
    q = random_postures(figure, 200, np.random.default_rng(1))
    limits = figure_limits(figure)
    assert all((outside == 0).all() for outside in excess(angles_of(figure, q), limits).values())
    q[:, figure.angle_index[DOFS.index("left_knee.flexion")]] = np.radians(-20.0)
    q[:, figure.angle_index[DOFS.index("left_hip.rotation")]] = 0.0
    outside = excess(angles_of(figure, q), limits)
    np.testing.assert_allclose(outside.pop("left_hip"), 20.0)
    assert all((each == 0).all() for each in outside.values())


def test_the_human_turns_its_spine_in_the_order_that_is_said(
    figure: Figure, counterparts: dict[str, Counterpart], held: Path
) -> None:
    q = random_postures(figure, 16, np.random.default_rng(2))
    postures = figure.forward_kinematics(q)[:, : len(JOINTS)]
    human = Validator(HUMAN_NAME, ranges=str(held), checks=("reach", "joint-range"))
    report = human.check(postures, lengths=figure.lengths)
    assert report.fk_distance.max() < 1e-4
    angles, columns = in_human_order(figure, postures), joint_columns(human)
    own = angles_of(figure, q)
    fits = report.valid
    assert fits.sum() > 10
    signed = {
        dof: found.sign * (np.degrees(report.q[:, columns[found.joint]]) - found.offset)
        for dof, found in counterparts.items()
    }
    theirs = readings(signed)
    for part, ways in readings(angles).items():  # two of them can be inside the limits
        off = [np.abs(np.mod(way - theirs[part][0] + 180, 360) - 180).max(axis=1) for way in ways]
        assert np.min(off, axis=0)[fits].max() < 0.1, part
    # It is another order: the same angles read by degrees otherwise.
    assert np.abs(angles["pelvis.rotation"] - own["pelvis.rotation"]).max() > 5


def test_the_closed_form_places_the_human_on_the_posture(
    figure: Figure, counterparts: dict[str, Counterpart]
) -> None:
    q = random_postures(figure, 200, np.random.default_rng(4))
    postures = figure.forward_kinematics(q)[:, : len(JOINTS)]
    model = load_robot(HUMAN_NAME, geometry=False).model
    kinematics = scaled(find_joint_map(model).kinematics(model), figure.lengths).kinematics
    order = [kinematics.names.index(joint) for joint in JOINTS]
    off = {}
    for name, angles in (("theirs", in_human_order(figure, postures)), ("ours", angles_of(figure, q))):
        on_human = np.tile(kinematics.neutral, (len(q), 1))
        for dof, (joint, sign, offset) in counterparts.items():
            on_human[:, model.idx_qs[model.getJointId(joint)]] = np.radians(sign * angles[dof] + offset)
        placed = kinematics.positions(on_human)[:, order]
        apart = [np.linalg.norm(each[:, :, None] - each[:, None], axis=3) for each in (placed, postures)]
        off[name] = np.abs(apart[0] - apart[1]).max(axis=(1, 2))
        # Distances do not tell a posture from its mirror image: the trunk and the two hips' volume does.
        a, b, c, d = (JOINT[joint] for joint in ("neck", "pelvis", "right_shoulder", "right_hip"))
        volumes = [np.linalg.det(each[:, [b, c, d]] - each[:, [a]]) for each in (placed, postures)]
        off[name] += np.abs(volumes[0] - volumes[1])
    assert off["theirs"].max() < 1e-5  # offsets are rounded to a thousandth of a degree
    assert np.median(off["ours"]) > 0.01


# The labelled postures.


def test_half_are_legal_and_the_kinds_are_balanced(labelled: Labelled) -> None:
    assert Counter(labelled.kind) == {"legal": 25} | dict.fromkeys(ILLEGAL_KINDS, 5)
    assert labelled.joints.shape == (50, 14, 3)


def test_the_same_seed_gives_the_same_postures(figure: Figure) -> None:
    one, other = (labelled_postures(figure, 5, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(one.joints, other.joints)
    assert one.what == other.what


@pytest.mark.parametrize("n", [0, -5, 7])
def test_a_number_that_cannot_be_shared_out_is_refused(figure: Figure, n: int) -> None:
    with pytest.raises(InputError, match=f"{n} postures were asked for"):
        labelled_postures(figure, n, np.random.default_rng(0))


def test_stretched_segments_are_longer_by_what_is_said(figure: Figure, labelled: Labelled) -> None:
    stretched = [k for k, kind in enumerate(labelled.kind) if "stretched" in kind]
    assert len(stretched) == 10
    for k in stretched:
        segment, longer, _ = labelled.what[k].split()
        a, b = segment.split("-")
        length = np.linalg.norm(labelled.joints[k, JOINT[a]] - labelled.joints[k, JOINT[b]])
        assert length - figure.lengths[segment] == pytest.approx(float(longer) / 100, abs=0.006)
        assert length - figure.lengths[segment] > 0.03


def test_the_stick_figure_says_what_the_labels_say(labelled: Labelled, judged: tuple[Report, Report]) -> None:
    wanted = ["valid" if kind == "legal" else "invalid" for kind in labelled.kind]
    assert judged[0].verdicts == wanted
    rejected_by = {
        "beyond a limit": "joint_range",
        "bent the wrong way": "joint_range",
        "arm through the trunk": "collision",
        "limb stretched": "rigid_parts",
        "trunk stretched": "rigid_parts",
    }
    for k, kind in enumerate(labelled.kind):
        checks = {each.check for each in judged[0].judgements if each.violated[k].any()}
        assert kind == "legal" or rejected_by[kind] in checks


# Two judges.


def test_the_human_agrees_but_for_the_order_of_its_spine(
    figure: Figure, labelled: Labelled, judged: tuple[Report, Report], counterparts: dict[str, Counterpart]
) -> None:
    expected = excess(in_human_order(figure, labelled.joints), limits_of_human(judged[1], counterparts))
    for one, other in (judged, tuple(without_collision(report) for report in judged)):
        why = reasons(labelled, one, other, expected, mapped=True)
        assert len(why) == len(labelled.kind)
        differ = [k for k, reason in enumerate(why) if reason]
        assert differ == [
            k for k, (a, b) in enumerate(zip(one.verdicts, other.verdicts, strict=True)) if a != b
        ]
        assert 0 < len(differ) <= 0.2 * len(why)
        for k in differ:
            assert why[k].startswith(SPINE_ORDER) or (
                why[k] == LONG_TRUNK and labelled.what[k].startswith("neck-pelvis")
            )
            assert other.verdicts[k] != "valid"


def test_each_reason_is_told_from_the_others(labelled: Labelled, judged: tuple[Report, Report]) -> None:
    stick, human = judged
    legal = next(k for k, verdict in enumerate(human.verdicts) if verdict == "valid")
    inside = {"pelvis": np.zeros(len(labelled.kind)), "left_hip": np.zeros(len(labelled.kind))}
    assert reasons(labelled, stick, human, inside, mapped=True)[legal] == ""
    hit = next(each for each in human.judgements if each.check == "collision").violated
    hit[legal] = True
    struck = Report(
        judgements=human.judgements, complete=human.complete, q=human.q, fk_distance=human.fk_distance
    )
    assert reasons(labelled, stick, struck, inside, mapped=True)[legal] == CAPSULE_REASON
    hit[legal] = False
    other = next(k for k, (a, b) in enumerate(zip(stick.verdicts, human.verdicts, strict=True)) if a > b)
    assert stick.verdicts[other] == "valid"
    assert reasons(labelled, stick, human, inside, mapped=True)[other] == SEARCH_REASON
