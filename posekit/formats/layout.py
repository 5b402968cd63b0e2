"""Layouts: mappings from a file's point names or indices to joints, from TOML files (built-in or the user's)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.errors import nearest, refusal, shown
from posekit.files import DATA, parse_toml, read_bytes
from posekit.geometry import Array
from posekit.geometry.landmarks import PELVIS_SHARE, hips_from_markers, middles, place_neck
from posekit.skeleton import FEET_POINTS, NAMES, POINTS, SIDES, other_side

FOLDER: Final = DATA / "layouts"
#: Landmarks that are not joints: the midpoint of the shoulders is not the neck, that of the hips is not the pelvis.
MIDDLES: Final = ("mid_shoulders", "mid_hips")
LANDMARKS: Final = (*POINTS, *MIDDLES)
#: Landmarks that every layout of a body defines.
PARTS: Final = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
LIMBS: Final = tuple(f"{side}_{part}" for part in PARTS for side in SIDES)

#: Names of a file's points by posekit's name; the mean of several points is used.
Placed = dict[str, tuple[str, ...]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """Mapping from a file's points, names or columns to posekit's landmarks.

    Attributes
    ----------
    name : str
        Name, such as ``coco_17``, or the path of a user's file.
    kind : str
        ``points``, ``names`` (naming conventions of animation programs), ``robot`` (order of joints) or ``robot-file``.
    points : tuple of str
        Names of the format's points in order; empty if files state the names.
    landmarks : dict
        For each landmark (`LANDMARKS`), the names of the file's points; the landmark is the mean of these points.
    feet : dict
        For each toe and heel (`posekit.skeleton.FEET_POINTS`), the names of the file's points.
    fields : dict
        All other fields of the TOML file, such as ``source``, ``up`` and ``unit``; for a robot also the arrays or
        columns of the root.
    """

    name: str
    kind: str = "points"
    points: tuple[str, ...] = ()
    landmarks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    feet: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    fields: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sources(self) -> dict[str, tuple[str, ...]]:
        """Names of the file's points for each landmark, toe and heel."""
        return {**self.landmarks, **self.feet}

    def gather(self, points: Array, names: Sequence[str] = ()) -> dict[str, Array]:
        """Compute landmarks from a file's points.

        Parameters
        ----------
        points : array (..., P, D)
            Positions of the file's points; NaN for missing points.
        names : sequence of str (P,), optional
            Names of the points; by default those of the layout.

        Returns
        -------
        dict of array (..., D)
            Positions by landmark or foot point. A landmark is NaN if one of its points is missing, and omitted if the
            file has none of its points.
        """
        column = {plain(name): k for k, name in reversed(list(enumerate(names or self.points)))}
        found = {
            ours: points[..., [column[plain(part)] for part in parts], :].mean(axis=-2)
            for ours, parts in self.sources.items()
            if _in(parts, column)
        }
        markers = self.fields.get("hips", {})
        if markers and points.shape[-1] == 3 and _in(tuple(markers.values()), column):
            right, left, back = (points[..., column[plain(markers[k])], :] for k in ("right", "left", "back"))
            found |= dict(zip(("right_hip", "left_hip"), hips_from_markers(right, left, back), strict=True))
        return found

    def seen(self, names: Sequence[str], values: Array) -> tuple[tuple[str, ...], Array, tuple[str, ...]]:
        """Map a detector's image points (N, P, D) to posekit's points; compute neck and pelvis if they are absent.

        A detector's neck is the midpoint of the shoulders. The figure's pelvis is between the neck and the midpoint of
        the hips, near the hips. Neck and pelvis are computed in the image; bent spines and perspective cause errors of
        1 to 2 cm.
        """
        found = self.gather(values, names)
        found = {**middles(found), **found}
        derived = []
        shoulders, hips = found.get("mid_shoulders"), found.get("mid_hips")
        if "neck" not in found and shoulders is not None:
            found["neck"] = shoulders
            derived.append("neck")
        if "pelvis" not in found and shoulders is not None and hips is not None:
            share = PELVIS_SHARE if values.shape[-1] > 1 else 0.5  # the confidence is the mean of both
            found["pelvis"] = shoulders + share * (hips - shoulders)
            derived.append("pelvis")
        return *_in_order(found, values), tuple(derived)

    def place(self, names: Sequence[str], points: Array) -> tuple[tuple[str, ...], Array, tuple[str, ...]]:
        """Map a file's 3D points to posekit's points; compute neck and pelvis if the file lacks them.

        Parameters
        ----------
        names : sequence of str (P,)
            Names in the file, or () for those of the layout.
        points : array (T, P, 3)
            Positions.

        Returns
        -------
        names : tuple of str (K,)
            Names from `posekit.skeleton.NAMES`, in that order.
        points : array (T, K, 3)
            Positions, in the unit of the given points.
        derived : tuple of str
            Joints that were computed from other joints, because the file has no point for them.
        """
        found = self.gather(points, names)
        for name, middle in middles(found).items():
            found[name] = np.where(np.isnan(middle), found.get(name, middle), middle)
        derived = tuple(name for name in ("pelvis", "neck") if name not in found)
        if not {"mid_shoulders", "mid_hips", "right_shoulder", "left_shoulder"} <= set(found):
            derived = ()
        if "pelvis" in derived:
            spine = found["mid_hips"] - found["mid_shoulders"]
            found["pelvis"] = found["mid_shoulders"] + PELVIS_SHARE * spine
        if "neck" in derived:
            found["neck"] = place_neck(found)
        return *_in_order(found, points), derived


def _in_order(found: Mapping[str, Array], points: Array) -> tuple[tuple[str, ...], Array]:
    """Stack landmarks in the order of `posekit.skeleton.NAMES`."""
    placed = tuple(name for name in NAMES if name in found)
    return placed, np.stack([found[name] for name in placed], axis=-2) if placed else points[..., :0, :]


def plain(name: str) -> str:
    """Return a name's letters in lower case and its digits, without a prefix that ends in a colon, for comparison."""
    return re.sub(r"[\W_]+", "", name.rpartition(":")[2].casefold())


def _in(parts: Sequence[str], there: Mapping[str, Any]) -> bool:
    return all(plain(part) in there for part in parts)


def layout_names() -> tuple[str, ...]:
    """Return the names of the built-in layouts."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load_layout(name: str | Path) -> Layout:
    """Load a layout by its name, or from a TOML file.

    Raises
    ------
    InputError
        If there is no such layout, or it refers to an unknown landmark or point.

    Examples
    --------
    >>> load_layout("coco_17").landmarks["right_wrist"]
    ('right_wrist',)
    """
    if str(name).endswith(".toml"):
        return _layout(parse_toml(read_bytes(name), str(name)), str(name))
    if str(name) not in layout_names():
        remedy = f"give a TOML file, or {nearest(str(name), layout_names())}"
        raise refusal("", "layout", shown(str(name)), "the name of a layout", remedy)
    return _built_in(str(name))


@cache
def _built_in(name: str) -> Layout:
    return _layout(parse_toml(read_bytes(FOLDER / f"{name}.toml"), name), name)


def _layout(table: dict[str, Any], name: str) -> Layout:
    kind = table.get("kind", "points")
    if kind == "points" and not isinstance(table.get("landmarks"), dict):
        raise refusal(name, "landmarks", shown(table.get("landmarks")), "a table", "add [landmarks]")
    points = tuple(table.get("points", ()))
    known = [plain(point) if isinstance(point, str) else "" for point in points]
    for point, word in zip(points, known, strict=True):
        if not word or known.count(word) > 1:
            raise refusal(name, "points", shown(point), "names that differ in letters or digits", "rename it")
    parts = {
        title: _parts(table.get(title, {}), title, order, points, name)
        for title, order in (("landmarks", LANDMARKS), ("feet", FEET_POINTS))
    }
    known_keys = ("points", "landmarks", "feet", "kind", "schema")
    own = {key: value for key, value in table.items() if key not in known_keys}
    return Layout(name=name, kind=kind, points=points, fields=own, **parts)


def _parts(table: Any, title: str, order: Sequence[str], points: Sequence[str], name: str) -> Placed:
    if not isinstance(table, dict):
        raise refusal(name, title, shown(table), "a table", f"write it as [{title}]")
    placed: Placed = {}
    for ours, given in table.items():
        found = (given,) if isinstance(given, str) else given
        where = f"{title}.{ours}"
        if ours not in order:
            raise refusal(name, where, "an unknown landmark", "a known one", nearest(ours, order))
        if not isinstance(found, list | tuple) or not found or not all(isinstance(one, str) for one in found):
            raise refusal(name, where, shown(given), "a name, or a list of names")
        unknown = [one for one in found if points and one not in points]
        if unknown or len(set(found)) != len(found):
            got = unknown[0] if unknown else "a name twice"
            raise refusal(name, where, shown(got), "different names of its points", nearest(got, points))
        placed[ours] = tuple(found)
    for ours, found in placed.items():
        if other_side(ours) != ours and placed.get(other_side(ours)) == found:
            got = f"{shown(list(found))}, as {other_side(ours)}"
            raise refusal(name, f"{title}.{ours}", got, "points of its own")
    return placed


def by_order(count: int) -> list[Layout]:
    """List the layouts of files with `count` points without names."""
    every = map(_built_in, layout_names())
    return [one for one in every if one.points and count in one.fields.get("counts", [len(one.points)])]


def by_names(names: Sequence[str], source: str) -> Layout:
    """Find the layout of a file that names its points.

    A layout fits if it defines all joints of every limb. If several layouts fit, the first criterion that differs
    decides: exactly the file's points; more identically spelt names (``RHip`` differs from ``r_hip``); more landmarks;
    points by name, not by order; more used names. If no layout fits, the naming conventions of animation programs are
    tried, then layouts that define shoulders, hips and half of the other limb joints.

    Raises
    ------
    InputError
        If no layout fits; the message names the nearest layout and its missing joints.
    """
    there, verbatim = {plain(name): name for name in names}, set(names)
    every = [one for one in map(_built_in, layout_names()) if one.kind == "points"]

    def lacking(one: Layout) -> list[str]:
        hips = one.fields.get("hips", {})
        by_pelvis = ("right_hip", "left_hip") if hips and _in(tuple(hips.values()), there) else ()
        asked = [limb for limb in LIMBS if limb not in by_pelvis]
        return [limb for limb in asked if not _in(one.landmarks.get(limb, ("\0",)), there)]

    fitting = [one for one in every if not lacking(one)]

    def rank(one: Layout) -> tuple[bool, int, int, bool, int]:
        exact = bool(one.points) and {plain(point) for point in one.points} == set(there)
        as_written = sum(set(one.landmarks.get(limb, ())) <= verbatim for limb in LIMBS)
        placed = [parts for parts in one.sources.values() if _in(parts, there)]
        return exact, as_written, len(placed), not one.points, sum(map(len, placed))

    if fitting:
        return max(fitting, key=rank)
    habit = _by_habit(names)
    if habit is not None:
        return habit
    near = min(every, key=lambda one: len(lacking(one)))
    missing = lacking(near)
    if len(missing) <= len(LIMBS) // 2 and "right_shoulder" not in missing and "right_hip" not in missing:
        return near
    if len(missing) == len(LIMBS):
        got = ", ".join(names[:8]) + (", …" if len(names) > 8 else "")
        remedy = "write which name is which joint into a TOML file, and give it with --layout"
        raise refusal(source, "points", got, "names of one of the layouts", remedy)
    got = f"no {', no '.join(missing)} by the layout {near.name}, which has most of the names"
    expected = f"{', '.join(near.landmarks.get(missing[0], ('a name',)))} for {missing[0]}, and so on"
    raise refusal(source, "points", got, expected, "rename the points, or give your own --layout")


def _by_habit(names: Sequence[str]) -> Layout | None:
    """Return a layout of an animation program's names: each consists of a common prefix, a side and a body part."""
    habits = _built_in("animation").fields
    prefix = _common_prefix(names)
    found: dict[tuple[str, str], str] = {}
    for name in names:
        words = _words(name.rpartition(":")[2].removeprefix(prefix), habits["left"], habits["right"])
        if words is not None:
            found.setdefault(words, name)
    placed: dict[str, tuple[str, ...]] = {}
    for ours, alternatives in habits["parts"].items():
        part = next((one for one in alternatives if {("left", one), ("right", one)} <= found.keys()), None)
        if part is not None:
            for side in ("right", "left"):
                placed[f"{side}_{ours}"] = (found[side, part],)
    if not set(LIMBS) <= set(placed):
        return None
    feet = {name: parts for name, parts in placed.items() if name in FEET_POINTS}
    return Layout(
        name="animation",
        points=tuple(names),
        landmarks={name: parts for name, parts in placed.items() if name not in feet},
        feet=feet,
        fields={"source": habits["source"]},
    )


def _common_prefix(names: Sequence[str]) -> str:
    """Return the longest prefix of most names that ends in a separator: ``Bip01_``, ``Character1_``, ``J_Bip_``."""
    starts = {name[: match.end()] for name in names for match in re.finditer(r"[_ .-]", name)}
    common = [start for start in starts if 2 * sum(name.startswith(start) for name in names) > len(names)]
    return max(common, key=len, default="")


def _words(name: str, left: Sequence[str], right: Sequence[str]) -> tuple[str, str] | None:
    """Split a name into side and body part: ``lThigh``, ``thigh_l``, ``LeftThigh`` become ("left", "thigh")."""
    pieces = [piece for piece in re.split(r"[\W_]+|(?<=[a-z])(?=[A-Z])|(?<=^[LR])(?=[A-Z])", name) if piece]
    words = [piece.casefold() for piece in pieces]
    for side, signs in (("left", left), ("right", right)):
        for place in (0, -1):
            if len(words) > 1 and words[place] in signs:
                del words[place]
                return side, "".join(words)
            # Old tools write the side without a separator: ``lfemur``, ``rshoulder``.
        if len(words) == 1 and words[0][:1] in signs and len(words[0]) > 3:
            return side, words[0][1:]
    return None
