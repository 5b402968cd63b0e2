"""What the parts of the figure weigh: Pinocchio, MuJoCo and the centre of mass of a posture agree."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.body.figure import Figure
from posekit.body.inertias import MASS_OF_STATURE_SQUARED, TURNED_MASS, inertias
from posekit.body.stature import stature_from_lengths
from posekit.formats.motion.urdf_folder import mujoco_text
from posekit.ranking.centre_of_mass import centre_of_mass

FIGURE = load_figure()


def person(stature: float) -> Figure:
    return FIGURE.from_stature(stature)


def in_between(figure: Figure) -> int:
    links = ElementTree.fromstring(figure.urdf).findall("link")
    return sum(link.get("name", "").endswith(("_flexed", "_bent", "_abducted")) for link in links)


def test_the_urdf_has_what_its_lengths_say() -> None:
    robot = ElementTree.fromstring(FIGURE.urdf)
    for name, (mass, centre, moments) in inertias(FIGURE.lengths).items():
        inertial = robot.find(f"link[@name='{name}']/inertial")
        assert inertial is not None
        said = {child.tag: child.attrib for child in inertial}
        assert float(said["mass"]["value"]) == pytest.approx(mass, rel=1e-5)
        np.testing.assert_allclose([float(x) for x in said["origin"]["xyz"].split()], centre, rtol=1e-5)
        spelled = [float(said["inertia"][axis]) for axis in ("ixx", "iyy", "izz")]
        np.testing.assert_allclose(spelled, moments, rtol=1e-5)


@pytest.mark.parametrize("stature", [1.1, 1.6, 1.95])
def test_a_body_weighs_what_its_stature_says(stature: float) -> None:
    figure = person(stature)
    expected = MASS_OF_STATURE_SQUARED * stature_from_lengths(figure.lengths) ** 2
    # The table's means add up to 99.99 %.
    parts = sum(part.mass for part in figure.model.inertias) - in_between(figure) * TURNED_MASS
    assert parts == pytest.approx(0.9999 * expected, rel=2e-4)


def test_moments_can_be_those_of_a_body() -> None:
    for _, _, moments in inertias(FIGURE.lengths).values():
        assert (moments > 0).all() and 2 * moments.max() < moments.sum()


@pytest.mark.parametrize("figure", [FIGURE, person(1.8)], ids=["built in", "1.8 m"])
def test_mujoco_and_pinocchio_agree(figure: Figure, rng: np.random.Generator) -> None:
    theirs = mujoco.MjModel.from_xml_string(mujoco_text(figure))
    state, data = mujoco.MjData(theirs), figure.model.createData()
    assert theirs.body_mass.sum() == pytest.approx(pin.computeTotalMass(figure.model), rel=1e-9)
    root = theirs.joint("root").qposadr[0]
    q = np.tile(pin.neutral(figure.model), (50, 1))
    q[:, :7] = rng.normal(size=(50, 7))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    q[:, 7:] = rng.uniform(figure.model.lowerPositionLimit[7:], figure.model.upperPositionLimit[7:], (50, 22))
    for row in q:
        state.qpos[root : root + 7] = row[[0, 1, 2, 6, 3, 4, 5]]
        for name, angle in zip(figure.configuration_names[7:], row[7:], strict=True):
            state.qpos[theirs.joint(name).qposadr[0]] = angle
        mujoco.mj_fwdPosition(theirs, state)
        whole = theirs.body_mass @ state.xipos / theirs.body_mass.sum()
        np.testing.assert_allclose(whole, pin.centerOfMass(figure.model, data, row), rtol=0, atol=1e-9)


def test_the_centre_is_that_of_a_posture(rng: np.random.Generator) -> None:
    q = pin.neutral(FIGURE.model)
    ours = centre_of_mass(FIGURE.forward_kinematics(q[None])[0, :14, :, None])[:, 0]
    theirs = pin.centerOfMass(FIGURE.model, FIGURE.model.createData(), q)
    # The grams between axes, and the table's 0.01 %, move it by less than a tenth of a millimetre.
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-4)


def test_mujoco_loads_the_file_as_it_is() -> None:
    path = Path(__file__).parents[2] / "urdf" / "stick_figure.urdf"
    assert mujoco.MjModel.from_xml_path(str(path)).njnt == len(FIGURE.configuration_names) - 7
