"""What an earlier run left in a folder, and whether this one goes on with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from posekit.batch.run_folder import Asked, RunFolder, differing
from posekit.batch.staging import Staged
from posekit.errors import InputError
from posekit.safe_io import cut


def known_before(folder: RunFolder, settings: Mapping[str, Any], hash: str, overwrite: bool) -> Asked | None:
    """Return what was asked of the run that was here, or refuse to mix it with another; None where it is void."""
    try:
        there = folder.asked()
    except InputError:
        if not overwrite:
            raise
        return None
    if there is None or there.hash == hash:
        return there
    if not overwrite:
        raise InputError(
            f"{folder.path}: holds a run with other settings ({cut(differing(there.settings, settings))}); expected "
            "the same; choose another folder, or give --overwrite to remove its results"
        )
    return None


def contents_of(
    there: Asked | None, staged: Sequence[Staged], folder: RunFolder, overwrite: bool
) -> dict[str, str]:
    """Return the contents of all inputs that results are of; refuse those that would double frames."""
    before = {} if there is None else there.inputs
    now = {one.name: one.digest for one in staged}
    if overwrite:
        return now
    for name, digest in now.items():
        if before.get(name, digest) != digest:
            raise InputError(
                f"{folder.path}: {name} has changed since its results were written there; expected the same content; "
                "choose another folder, or give --overwrite to remove them"
            )
    gone = {digest: name for name, digest in before.items() if name not in now}
    for name, digest in now.items():
        if name not in before and digest in gone:
            raise InputError(
                f"{folder.path}: {name} is there already as {gone[digest]}; expected each input once; give the same "
                "inputs as before, or another folder"
            )
    return {**before, **now}
