"""The anatomical table: every number has a source, limits are means and spreads, and bad files say what is wrong."""

import re
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.skeleton import DOFS
from posekit.tables.anatomy import MAX_COUPLINGS
from posekit.tables.angles import SIDELESS_ANGLES
from posekit.validators import Ranges, load_ranges
from posekit.validators.anatomical import Anatomy

TEXT = (resources.files("posekit.urdf") / "ranges" / "anatomical.toml").read_text(encoding="utf-8")
TABLE = load_ranges("anatomical")
assert TABLE.anatomy is not None
ANATOMY: Anatomy = TABLE.anatomy


def load(folder: Path, text: str) -> Ranges:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return load_ranges(str(path))


def test_it_limits_all_22_angles_and_is_no_default() -> None:
    assert (TABLE.name, TABLE.kind) == ("anatomical", "configuration")
    assert set(TABLE.limits) == set(DOFS)
    assert load_ranges("urdf").anatomy is None
    assert load_ranges("table1").anatomy is None


@pytest.mark.parametrize("dof", DOFS)
def test_a_limit_is_the_mean_and_so_many_spreads_outward(dof: str) -> None:
    motion = ANATOMY.motion(dof)
    for k, (end, outward) in enumerate(((motion.lower, -1), (motion.upper, 1))):
        spread = np.sqrt(end.spread**2 + motion.zero.spread**2)
        expected = end.mean + motion.zero.mean + outward * ANATOMY.spreads * spread
        assert TABLE.limits[dof][k] == pytest.approx(expected)
    wider = replace(ANATOMY, spreads=ANATOMY.spreads + 1).limits()[dof]
    assert wider[0] < TABLE.limits[dof][0] < TABLE.limits[dof][1] < wider[1]


def test_both_sides_are_alike() -> None:
    for dof in DOFS:
        if dof.startswith("right_"):
            assert TABLE.limits[dof] == TABLE.limits[dof.replace("right_", "left_")]


def test_every_number_has_a_source_and_every_source_is_used() -> None:
    ends = [end for motion in ANATOMY.motions.values() for end in (motion.lower, motion.upper)]
    ends += [motion.zero for motion in ANATOMY.motions.values() if motion.zero.mean]
    assert all(end.source for end in ends)
    assert all(coupling.source for coupling in ANATOMY.couplings)
    assert all(sinus.source for sinus in ANATOMY.sinuses)
    used = {key for end in ends for key in end.source} | {k for c in ANATOMY.couplings for k in c.source}
    used |= {key for sinus in ANATOMY.sinuses for key in sinus.source}
    assert used == set(ANATOMY.sources)


def test_the_clinics_zero_is_added_to_ends_and_couplings() -> None:
    # Standing, the hips lie before the pelvis joint: what flexes the trunk extends the hip by as much.
    pelvis, hip = ANATOMY.motions["pelvis.flexion"], ANATOMY.motions["hip.flexion"]
    assert pelvis.zero.mean == -hip.zero.mean > 0
    assert pelvis.end("upper")[0] == pytest.approx(pelvis.upper.mean + pelvis.zero.mean)
    (coupling,) = ANATOMY.couplings_of("hip.flexion")
    mean, spread = ANATOMY.coupled(coupling, np.array([-5.0, 0.0, 6.75, 13.5, 200.0]))
    np.testing.assert_allclose(mean, np.array([80.0, 80.0, 86.0, 92.0, 133.0]) + hip.zero.mean)
    assert spread == pytest.approx(np.hypot(coupling.spread, hip.zero.spread))


def test_the_table_as_a_file_is_the_table_by_name(tmp_path: Path) -> None:
    table = load(tmp_path, TEXT)
    assert table.anatomy == ANATOMY
    assert table.limits == TABLE.limits
    assert table.name.endswith("mine.toml")


def changed(old: str, new: str) -> str:
    assert TEXT.count(old) >= 1, old
    return TEXT.replace(old, new, 1)


NECK = "[neck.flexion]\nlower = { mean = -75.5, spread = 8.5,"
COUPLING = 'angle = "hip.flexion"'
WRONG = {
    "no spreads": (changed("spreads = ", "# spreads = "), "spreads: got nothing; expected this field"),
    "negative spreads": (
        changed("spreads = 0.8", "spreads = -1.0"),
        "spreads: got -1.0; expected a number of at least 0",
    ),
    "endless spreads": (changed("spreads = 0.8", "spreads = inf"), "spreads: got inf; expected a finite"),
    "a missing angle": (
        changed("[neck.flexion]", "[neck.extra]"),
        "neck.extra: got a name that is not an angle",
    ),
    "a missing joint": (
        TEXT.replace("[neck.rotation]", "[neck.bending2]").split("[neck.bending2]")[0]
        + TEXT[TEXT.index("[pelvis.flexion]") :],
        "got no neck.rotation",
    ),
    "a number for an angle": (
        changed("[neck.flexion]\nlower", "[neck]\nflexion = 3\nlower"),
        "neck.lower: got a name that is not an angle",
    ),
    "a joint that is no table": (
        changed("spreads = 0.8", "spreads = 0.8\nneck2 = 3"),
        "neck2: got 3; expected a table",
    ),
    "no upper": (
        changed("upper = { mean = 60.0", "uper = { mean = 60.0"),
        "neck.flexion.upper: got nothing; expected this field",
    ),
    "a further key": (
        changed(NECK, NECK.replace("mean", "men = 1, mean")),
        "neck.flexion.lower.men: got 1; expected no field of this name; did you mean mean",
    ),
    "a spread of zero": (changed("spread = 8.5", "spread = 0.0"), "expected a positive standard deviation"),
    "a negative spread": (changed("spread = 8.5", "spread = -1"), "expected a positive standard deviation"),
    "NaN": (
        changed("mean = -75.5", "mean = nan"),
        "neck.flexion.lower.mean: got nan; expected a finite number",
    ),
    "a truth value": (
        changed("mean = -75.5", "mean = true"),
        "neck.flexion.lower.mean: got true; expected a number",
    ),
    "a huge number": (
        changed("mean = -75.5", "mean = 1" + "0" * 400),
        "neck.flexion.lower.mean: got an integer that no float64 holds",
    ),
    "radians squared": (
        changed("mean = -75.5", "mean = -7550"),
        "neck.flexion.lower.mean: got -7550; expected a number of at least -360",
    ),
    "swapped ends": (
        changed("mean = -75.5", "mean = 75.5"),
        "neck.flexion: got means 75.5 and 60; expected the lower mean below the upper one",
    ),
    "more than a turn": (changed("mean = -75.5", "mean = -359"), "expected at most a full turn"),
    "a source that is none": (
        changed('source = "aaos"', 'source = "hearsay"'),
        'neck.flexion.lower.source: got "hearsay"; expected a key of [sources]',
    ),
    "a source that is a number": (
        changed('source = "aaos"', "source = 3"),
        "neck.flexion.lower.source: got 3; expected a list; name one or more keys",
    ),
    "sources that are numbers": (
        changed("[sources]", "[sources]\nx = 1"),
        "sources.x: got 1; expected a text",
    ),
    "a coupling of an unknown angle": (
        changed(COUPLING, 'angle = "ankle.flexion"'),
        'coupling[0].angle: got "ankle.flexion"',
    ),
    "a coupling across limbs": (
        changed('of = "knee.flexion"', 'of = "elbow.flexion"'),
        'coupling[0].of: got "elbow.flexion"; expected one that hip.flexion may depend on',
    ),
    "a coupling to itself": (
        changed('of = "knee.flexion"', 'of = "hip.flexion"'),
        'coupling[0].of: got "hip.flexion"',
    ),
    "a coupling without end": (
        changed('end = "upper"\nof = "knee', 'end = "left"\nof = "knee'),
        'coupling[0].end: got "left"',
    ),
    "a coupling of one point": (
        changed("[[0.0, 80.0], [13.5, 92.0], [60.0, 133.0]]", "[[0.0, 80.0]]"),
        "coupling[0].points: got a list of 1 entries; expected at least 2 entries",
    ),
    "a point of three numbers": (
        changed("[0.0, 80.0]", "[0.0, 80.0, 1.0]"),
        "coupling[0].points[0]: got [0.0, 80.0, 1.0]; expected at most 2 entries",
    ),
    "points out of order": (
        changed("[13.5, 92.0]", "[0.0, 92.0]"),
        "coupling[0].points: got points out of order; expected knee.flexion to ascend",
    ),
    "a point that is text": (
        changed("[13.5, 92.0]", '[13.5, "x"]'),
        'coupling[0].points[1][1]: got "x"; expected a number',
    ),
    "a coupling that is no table": (
        changed("spreads = 0.8", "spreads = 0.8\ncoupling = 3").split("[[coupling]]")[0],
        "coupling: got 3; expected a list; write [[coupling]] tables",
    ),
    "too many couplings": (
        TEXT + TEXT[TEXT.index("[[coupling]]") :] * MAX_COUPLINGS,
        f"entries; expected at most {MAX_COUPLINGS} entries",
    ),
    "a sinus of a joint without one": (
        changed('joint = "hip"', 'joint = "shoulder"'),
        'sinus[0].joint: got "shoulder"; expected',
    ),
    "a sinus sharper than a diamond": (
        changed("power = 3.0", "power = 0.5"),
        "sinus[0].power: got 0.5; expected a number of at least 1",
    ),
    "a sinus without source": (
        changed('power = 3.0\nsource = ["van_arkel", "han"]', "power = 3.0"),
        "sinus[0].source: got nothing; expected this field",
    ),
    "a power that is none": (
        changed("power = 3.0", 'power = "x"'),
        'sinus[0].power: got "x"; expected a number',
    ),
    "two sinuses of one joint": (
        TEXT + TEXT[TEXT.index("[[sinus]]") :],
        "sinus: got a list of 2 entries; expected at most 1 entries; write [[sinus]] tables",
    ),
    "a line break in a name": (
        changed("[neck.flexion]", '[neck."a\\nb"]'),
        "got a name that is not an angle",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_with(tmp_path: Path, name: str) -> None:
    text, match = WRONG[name]
    with pytest.raises(InputError, match=re.escape(match)) as error:
        load(tmp_path, text)
    assert "\n" not in str(error.value)
    assert "mine.toml" in str(error.value)


def test_a_table_without_couplings_or_sources_is_a_table(tmp_path: Path) -> None:
    bare = 'schema = "posekit.ranges/1"\nkind = "anatomical"\nspreads = 2\n' + "".join(
        f"[{angle}]\nlower = {{ mean = -30, spread = 5 }}\nupper = {{ mean = 40, spread = 10 }}\n"
        for angle in SIDELESS_ANGLES
    )
    table = load(tmp_path, bare)
    assert set(table.limits.values()) == {(-40.0, 60.0)}
    assert table.anatomy is not None
    assert table.anatomy.couplings == ()
    assert table.anatomy.sinuses == ()


def test_the_nearer_the_pelvis_to_the_hips_the_less_is_known_of_how_it_leans() -> None:
    limits = [ANATOMY.on_pelvis(metres).limits() for metres in (1.0, 0.1, 0.03, 0.0)]
    for dof in DOFS:
        widths = [upper - lower for lower, upper in (each[dof] for each in limits)]
        if dof.endswith(("pelvis.flexion", "hip.flexion")):
            assert (np.diff(widths) > 0).all()
        else:
            assert np.ptp(widths) == 0
    here = ANATOMY.on_pelvis(0.1)
    assert here.on_pelvis(0.01) is here  # it is known by then where the pelvis is
    between_the_hips = ANATOMY.on_pelvis(0.0).motions["hip.flexion"].zero
    assert between_the_hips.spread == pytest.approx(
        np.hypot(45.0, ANATOMY.motions["hip.flexion"].zero.spread)
    )


def test_hips_that_lie_elsewhere_move_what_the_pelvis_is_measured_by_alone() -> None:
    """By the part that the pelvis joint's place has in the variance, beside ten degrees of how somebody stands."""
    forward, outward = 14.0, 3.0
    found = ANATOMY.with_hips(forward, outward)
    by_pelvis = {angle for angle, one in ANATOMY.motions.items() if one.pelvis}
    assert 0 < len(by_pelvis) < len(ANATOMY.motions) - 1
    for angle, one in ANATOMY.motions.items():
        variance = one.zero.spread**2 + np.degrees(np.arctan(one.pelvis / 0.1)) ** 2
        moved = (
            variance / (variance + 10.0**2) * (forward - abs(one.zero.mean)) * np.copysign(1.0, one.zero.mean)
        )
        expected = {angle: 0.0} | ({angle: moved} if angle in by_pelvis else {}) | {"hip.abduction": -outward}
        assert found.motions[angle].moved == pytest.approx(expected[angle])
        assert replace(found.motions[angle], moved=one.moved) == one
    # On a body whose pelvis has its place nothing is left that could be elsewhere.
    told = ANATOMY.on_pelvis(0.1)
    moved_ = {angle for angle, one in told.with_hips(forward, outward).motions.items() if one.moved}
    assert moved_ == {"hip.abduction"} and any(told.motions[angle].zero.spread > 0 for angle in by_pelvis)
