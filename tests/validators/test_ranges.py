"""Tables of joint ranges: the built-in ones, and one clear line for each way a file can be wrong."""

import re
from pathlib import Path

import pytest

from posekit.errors import InputError
from posekit.skeleton import DOFS
from posekit.tables.angles import TABLE1_ANGLES
from posekit.validators import Ranges, load_ranges
from posekit.validators.ranges import RANGES_SCHEMA, URDF_RANGES

HEAD = f'schema = "{RANGES_SCHEMA}"\nkind = "configuration"\n'
PROJECTED = f'schema = "{RANGES_SCHEMA}"\nkind = "projected"\n'


def load(folder: Path, text: str | bytes) -> Ranges:
    path = folder / "mine.toml"
    if isinstance(text, str):
        path.write_text(text, encoding="utf-8")
    else:
        path.write_bytes(text)
    return load_ranges(str(path))


def test_the_default_leaves_every_limit_to_the_figure() -> None:
    assert load_ranges("urdf") is URDF_RANGES
    assert URDF_RANGES.kind == "configuration"
    assert not URDF_RANGES.limits


def test_table1_is_the_papers() -> None:
    table = load_ranges("table1")
    printed = load_ranges("table1-printed")
    assert (table.name, table.kind) == ("table1", "rotation")
    assert (printed.name, printed.kind, printed.limits) == ("table1-printed", "projected", table.limits)
    assert dict(table.limits) == {
        "shoulder.flexion": (-50, 180),
        "shoulder.abduction": (-50, 180),
        "hip.flexion": (-40, 120),
        "hip.flexion_with_straight_knee": (-40, 90),
        "hip.abduction": (-30, 45),
        "elbow.flexion": (0, 160),
        "knee.flexion": (0, 130),
        "pelvis.flexion": (-30, 75),
        "pelvis.rotation": (-30, 30),
        "pelvis.bending": (-35, 35),
        "neck.flexion": (-55, 45),
        "neck.rotation": (-70, 70),
        "neck.bending": (-40, 40),
    }


def test_a_file_names_some_of_the_figures_angles(tmp_path: Path) -> None:
    table = load(tmp_path, HEAD + "[right_elbow]\nflexion = [5, 140.5]\n[neck]\nrotation = [-1, 1]\n")
    assert dict(table.limits) == {"right_elbow.flexion": (5.0, 140.5), "neck.rotation": (-1.0, 1.0)}
    assert table.kind == "configuration"
    assert table.name.endswith("mine.toml")
    assert (table.shortest_projection, table.knee_flexed) == (0.1, 5.0)
    made = Ranges(name="mine", kind="projected")
    assert (made.shortest_projection, made.knee_flexed, made.limits, made.anatomy) == (0.1, 5.0, {}, None)


def test_a_file_may_name_all_of_them_or_none(tmp_path: Path) -> None:
    everything = "".join(
        f"[{joint}]\n"
        + "".join(f"{dof.split('.')[1]} = [-1, 1]\n" for dof in DOFS if dof.split(".")[0] == joint)
        for joint in dict.fromkeys(dof.split(".")[0] for dof in DOFS)
    )
    assert set(load(tmp_path, HEAD + everything).limits) == set(DOFS)
    assert not load(tmp_path, HEAD).limits


def test_a_projected_file_lists_every_angle_and_its_thresholds(tmp_path: Path) -> None:
    body = "".join(
        f"[{joint}]\n" + "".join(f"{angle} = [-10, 10]\n" for angle in angles)
        for joint, angles in TABLE1_ANGLES.items()
    )
    table = load(tmp_path, PROJECTED + "shortest_projection = 0.25\nknee_flexed = 12\n" + body)
    assert len(table.limits) == 13
    assert (table.shortest_projection, table.knee_flexed) == (0.25, 12.0)


def test_equal_bounds_are_a_range(tmp_path: Path) -> None:
    assert load(tmp_path, HEAD + "[neck]\nflexion = [3, 3]\n").limits == {"neck.flexion": (3, 3)}


WRONG = {
    "nothing": ("", "an empty file; expected a file with content"),
    "no schema": ("# nothing", 'schema: got nothing; expected "posekit.ranges/1"'),
    "another schema": (
        'schema = "posekit.ranges/9"',
        'schema: got "posekit.ranges/9"; expected "posekit.ranges/1"',
    ),
    "no kind": (f'schema = "{RANGES_SCHEMA}"', "kind: got nothing; expected this field"),
    "another kind": (
        f'schema = "{RANGES_SCHEMA}"\nkind = "euler"',
        "kind: got \"euler\"; expected 'configuration', 'rotation' or 'projected'",
    ),
    "no TOML": (HEAD + "[neck\n", "not TOML"),
    "a key twice": (HEAD + "[neck]\nflexion = [0, 1]\nflexion = [0, 1]\n", "not TOML"),
    "a control character": (HEAD + "a = \x01", "not TOML"),
    "a NUL": (HEAD + "a = \0", "a NUL character; expected text in UTF-8"),
    "deep nesting": (HEAD + "a = " + "[" * 50_000, "expected at most 16 levels"),
    "a key of many parts": (HEAD + "a." * 30 + "a = 1", "a key of 31 parts; expected at most 16 levels"),
    "a number of 5000 digits": (HEAD + f"[neck]\nflexion = [0, 1{'0' * 5000}]\n", "not TOML"),
    "a number of 400 digits": (
        HEAD + f"[neck]\nflexion = [0, 1{'0' * 400}]\n",
        "neck.flexion[1]: got an integer that no float64 holds; expected a finite number",
    ),
    "NaN": (HEAD + "[neck]\nflexion = [nan, 1]\n", "neck.flexion[0]: got nan; expected a finite number"),
    "infinity": (HEAD + "[neck]\nflexion = [0, inf]\n", "neck.flexion[1]: got inf; expected a finite number"),
    "a string": (
        HEAD + '[neck]\nflexion = ["0", 1]\n',
        'neck.flexion: got ["0", 1]; expected [lower, upper], two numbers',
    ),
    "a truth value": (
        HEAD + "[neck]\nflexion = [true, 1]\n",
        "neck.flexion: got [true, 1]; expected [lower, upper], two numbers",
    ),
    "one number": (
        HEAD + "[neck]\nflexion = 3\n",
        "neck.flexion: got 3; expected [lower, upper], two numbers",
    ),
    "three numbers": (
        HEAD + "[neck]\nflexion = [1, 2, 3]\n",
        "neck.flexion: got [1, 2, 3]; expected [lower, upper], two numbers",
    ),
    "swapped bounds": (
        HEAD + "[neck]\nflexion = [10, -10]\n",
        "neck.flexion: got [10, -10]; expected the lower one first; swap them",
    ),
    "an unknown joint": (
        HEAD + "[tail]\nflexion = [0, 1]\n",
        "tail.flexion: got a name that is not an angle; expected one of neck.flexion",
    ),
    "an unknown angle": (
        HEAD + "[neck]\nabduction = [0, 1]\n",
        "neck.abduction: got a name that is not an angle",
    ),
    "a joint of the other kind": (
        HEAD + "[shoulder]\nflexion = [0, 1]\n",
        "shoulder.flexion: got a name that is not an angle",
    ),
    "no table": (HEAD + "neck = 3\n", "neck: got 3; expected a table such as [neck]"),
    "a line break in a name": (HEAD + '["a\\nb"]\nflexion = [0, 1]\n', "a name that is not an angle"),
    "a line break in a key": (HEAD + '"a\\nb" = 3\n', "expected a table"),
    "missing angles": (
        PROJECTED + "[neck]\nflexion = [0, 1]\n",
        "got no shoulder.flexion, shoulder.abduction, elbow.flexion",
    ),
    "a threshold that is none": (
        HEAD + 'knee_flexed = "bent"\n',
        'knee_flexed: got "bent"; expected a number',
    ),
    "a negative threshold": (
        HEAD + "shortest_projection = -0.1\n",
        "shortest_projection: got -0.1; expected a number of at least 0",
    ),
    "a threshold of one": (
        HEAD + "shortest_projection = 1\n",
        "shortest_projection: got 1; expected less than 1",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_with(tmp_path: Path, name: str) -> None:
    text, match = WRONG[name]
    with pytest.raises(InputError, match=re.escape(match)) as error:
        load(tmp_path, text)
    assert "\n" not in str(error.value)
    assert "mine.toml" in str(error.value)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"\xff\xfe", "expected text in UTF-8"),
        (HEAD.encode("utf-16"), "expected text in UTF-8"),
        (b" " * 1_000_001, "1.0 MB; expected at most 1 MB"),
    ],
)
def test_a_file_that_is_no_text(tmp_path: Path, content: bytes, match: str) -> None:
    with pytest.raises(InputError, match=match):
        load(tmp_path, content)


@pytest.mark.parametrize("name", ["table2", "", "no/such/file.toml", "x" * 5000, "a\0b"])
def test_a_name_that_is_none(name: str) -> None:
    with pytest.raises(InputError, match="--ranges") as error:
        load_ranges(name)
    assert "\n" not in str(error.value)


def test_a_folder_is_no_table(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="got a directory; expected a file"):
        load_ranges(str(tmp_path))
