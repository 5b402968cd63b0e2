"""The child process that loads a robot first: what crashes here, crashes nothing else.

It is started by `posekit.robots.untrusted` with a request on its standard input, sets its own limits, does
everything native that its parent will do, and answers on what was its standard output.
"""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pinocchio as pin

from posekit.errors import PosekitError
from posekit.robots.pairs import neutral_inside_limits
from posekit.robots.robot import Robot
from posekit.robots.second_reader import compare_readers


def main() -> None:
    """Read the request, load the robot within the limits, and answer."""
    answers = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)  # native libraries print what they please
    request = json.load(sys.stdin)
    _set_limits(request["memory"], request["cpu"])
    answer: dict[str, Any] = {"ok": True}
    try:
        settings = request["robot"]
        settings["package_dirs"] = tuple(map(Path, settings["package_dirs"]))
        settings["mesh_copies"] = {name: Path(copy) for name, copy in settings.get("mesh_copies", {}).items()}
        answer["compared"] = exercise(Robot(**settings), compare=request["compare"])
    except PosekitError as error:
        answer = {"memory": True} if "std::bad_alloc" in str(error) else {"error": str(error)}
    except MemoryError:
        answer = {"memory": True}
    os.write(answers, json.dumps(answer).encode())


def exercise(robot: Robot, *, compare: bool) -> bool:
    """Do with a robot what is native in using it: forward kinematics, one collision query, the second reader."""
    model, data = robot.model, robot.model.createData()
    q = neutral_inside_limits(model)
    pin.framesForwardKinematics(model, data, q)
    if robot.geometry is not None:
        geometry_data = robot.geometry.createData()
        pin.computeCollisions(model, data, robot.geometry, geometry_data, q, False)
    return compare and compare_readers(robot.urdf, model, robot.source, must_read=False)


def _set_limits(memory: int, cpu: int) -> None:
    """Bound memory (bytes) and processor time (s), write no file and leave no core dump."""
    import resource

    bounds = {
        resource.RLIMIT_AS: (memory, memory),
        resource.RLIMIT_CPU: (cpu, cpu + 5),  # the first sends SIGXCPU, the second SIGKILL
        resource.RLIMIT_FSIZE: (0, 0),
        resource.RLIMIT_CORE: (0, 0),
    }
    for kind, bound in bounds.items():
        with suppress(ValueError, OSError):  # a lower bound is set already, or the system knows none such
            resource.setrlimit(kind, bound)


if __name__ == "__main__":
    main()
