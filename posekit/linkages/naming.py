"""Finding nodes and segments by name, with the nearest valid names where there is none."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from posekit.errors import InputError
from posekit.safe_io.refusal import MAX_SHOWN_CHARACTERS, cut, one_line

MAX_NAMES_LISTED = 20
"""Valid names that are listed before the list is cut."""


def shown(name: str) -> str:
    """Show a name on one line, cut to a readable length."""
    return one_line(cut(name))


def meant(name: str, names: Sequence[str]) -> str:
    """Suggest what a name was meant to be: the nearest valid names, or the valid names where none is near."""
    near = difflib.get_close_matches(name[:MAX_SHOWN_CHARACTERS], names)
    if near:
        return f"did you mean {' or '.join(near)}?"
    listed = [shown(valid) for valid in names[:MAX_NAMES_LISTED]]
    return f"expected {', '.join(listed)}{', …' if len(names) > MAX_NAMES_LISTED else ''}"


def find(where: str, name: str, nodes: Sequence[str]) -> int:
    """Return the index of a node.

    Raises
    ------
    InputError
        Where there is none of that name.
    """
    if name not in nodes:
        raise InputError(f"{where}: there is no point {shown(name)}; {meant(name, nodes)}")
    return list(nodes).index(name)


def split_segment(where: str, name: str, nodes: Sequence[str]) -> tuple[int, int]:
    """Split ``a-b`` into the indices of a and b; either name may have hyphens of its own.

    Raises
    ------
    InputError
        Where no split, or more than one, gives two nodes.
    """
    parts = name.split("-")
    if len(parts) > 50:
        raise InputError(f"{where}: segment {shown(name)} has {len(parts) - 1} hyphens; expected a-b")
    splits = [("-".join(parts[:k]), "-".join(parts[k:])) for k in range(1, len(parts))]
    known = [split for split in splits if split[0] in nodes and split[1] in nodes]
    if len(known) == 1:
        a, b = known[0]
        return list(nodes).index(a), list(nodes).index(b)
    if known:
        raise InputError(
            f"{where}: segment {shown(name)} can be read in {len(known)} ways; rename a point that has a hyphen"
        )
    if not splits:
        raise InputError(f"{where}: segment {shown(name)}; expected two points joined by a hyphen, a-b")
    # The split that has a known end tells which name is wrong.
    a, b = next((split for split in splits if split[0] in nodes or split[1] in nodes), splits[0])
    unknown = a if a not in nodes else b
    raise InputError(
        f"{where}: segment {shown(name)}: there is no point {shown(unknown)}; {meant(unknown, nodes)}"
    )
