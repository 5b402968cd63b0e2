"""Load a robot from a stranger in a child process first: a crash there is an error message here."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from posekit.errors import InputError
from posekit.safe_io import refusal

_CODE: Final = "import sys; sys.path.append(sys.argv[1]); from posekit.robots.probe import main; main()"
_ONE_THREAD: Final = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
"""Each thread of a numerical library takes address space, which is what is bounded."""


@dataclass(frozen=True, kw_only=True)
class ProbeLimits:
    """What a child process may take.

    Parameters
    ----------
    memory : int
        Bytes of address space; an empty probe takes 0.2e9, the second reader as much again.
    cpu : int
        Seconds of processor time.
    wall : float
        Seconds on the clock.
    """

    memory: int = 2_000_000_000
    cpu: int = 60
    wall: float = 120.0


def probe(settings: dict[str, Any], *, compare: bool, limits: ProbeLimits | None = None) -> None:
    """Load a robot in a child process, and do there everything native that is done with it later.

    Parameters
    ----------
    settings : dict
        The arguments of `posekit.robots.Robot`.
    compare : bool
        Whether a second reader must agree, where it can read the text.
    limits : ProbeLimits, optional
        What the child may take.

    Raises
    ------
    InputError
        What the child found wrong; or that it was ended, by which signal, or took too much.
    """
    limits = limits or ProbeLimits()
    source = str(settings["source"])
    request = {
        "robot": settings,
        "compare": compare,
        "memory": limits.memory,
        "cpu": limits.cpu,
    }
    home = str(Path(__file__).parents[2])  # where posekit lies, if it is not installed
    try:
        child = subprocess.run(
            [sys.executable, "-P", "-c", _CODE, home],
            input=json.dumps(request, default=str).encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=limits.wall,
            env={**os.environ, **_ONE_THREAD},
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise _ended(source, f"a process that took more than {limits.wall:g} s") from None
    except OSError as error:
        got = f"no child process: {error.strerror}"
        raise refusal(source, "", got, "a Python that can be started", "load it as trusted") from error
    try:
        answer = json.loads(child.stdout)
    except ValueError:
        raise _ended(source, _cause(child.returncode, limits)) from None
    if answer.get("memory"):
        raise _ended(source, f"a process that needs more than {limits.memory / 1e9:g} GB of memory")
    if "error" in answer:
        raise InputError(answer["error"])


def _cause(code: int, limits: ProbeLimits) -> str:
    """Say in words how a child ended that gave no answer."""
    if code >= 0:
        return f"a process that ended with exit status {code}"
    if -code == signal.SIGXCPU:
        return f"a process that took more than {limits.cpu} s of processor time"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = " (as when memory runs out)" if -code in (signal.SIGABRT, signal.SIGKILL) else ""
    return f"a process that ended with {name}{hint}"


def _ended(source: str, cause: str) -> InputError:
    remedy = "check the file and its meshes; do not load it as trusted"
    return refusal(source, "", cause, "a model that Pinocchio and coal can load", remedy)
