"""A Ray cluster: the same function on other machines, tasks that are tried again where a process or a machine dies.

Ray, "Fault tolerance: tasks" (docs.ray.io/en/latest/ray-core/fault_tolerance/tasks.html): `max_retries` counts only
deaths of workers and nodes; an error that a task raises is raised where its result is asked for.
"""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from ipaddress import ip_address
from itertools import islice
from types import TracebackType
from typing import Any, Final, TypeVar

from posekit.batch.pool import Outcome, attempt, short
from posekit.errors import InputError
from posekit.safe_io import extra

T = TypeVar("T")
R = TypeVar("R")
LOCAL_CLUSTER: Final = "local"
"""Instead of an address: a cluster of this machine alone, started and ended with the run."""
TASKS_AHEAD: Final = 2
"""Tasks in flight for each core of the cluster: one that runs and one that waits."""
ANSWERS_WITHIN: Final = 10.0
"""Seconds for a cluster to answer at all: Ray itself waits for minutes, and complains meanwhile."""
FOUND_WITHIN: Final = 30.0
"""Seconds for `ray status` to find a cluster at an address, 1.3 s on a quiet machine: what listens may be no Ray."""
LOOPBACK_SWITCH: Final = "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"
LEAST_RAY_VERSION: Final = (2, 55)
"""The oldest version whose retries are relied on."""


@dataclass(eq=False)
class RayPool:
    """A pool of Ray's workers. The run's folder and the inputs must have the same path on every machine.

    Parameters
    ----------
    address : str
        As ``ray.init`` takes it, or `LOCAL_CLUSTER`.
    jobs : int
        Cores of a local cluster.
    retries : int
        How often a task is tried again whose worker died.
    """

    address: str
    jobs: int
    retries: int
    ray: Any = field(init=False)

    def __enter__(self) -> RayPool:
        """Connect.

        Raises
        ------
        InputError
            Where Ray is not installed or too old, or nothing answers there.
        """
        self.ray = extra("ray", "ray", "--cluster")
        if tuple(int(part) for part in self.ray.__version__.split(".")[:2]) < LEAST_RAY_VERSION:
            raise InputError(
                f"--cluster: ray is {self.ray.__version__}; expected {'.'.join(map(str, LEAST_RAY_VERSION))} or later; "
                "update it"
            )
        self._find()
        common: dict[str, Any] = {"log_to_driver": False, "logging_level": "error", "configure_logging": True}
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nobody is told of the run
        try:
            if self.address == LOCAL_CLUSTER:
                with _loopback():
                    self.ray.init(num_cpus=self.jobs, include_dashboard=False, **common)
            else:
                self.ray.init(address=self.address, **common)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise self._refusal(short(str(error))) from None
        where = self.ray.util.get_node_ip_address()
        if self.address == LOCAL_CLUSTER and not ip_address(where).is_loopback:
            self.ray.shutdown()
            raise self._refusal(f"ray {self.ray.__version__} listens on {where}, not on this machine alone")
        return self

    def _find(self) -> None:
        """Refuse an address where nothing listens, or something else than a cluster: Ray would wait for minutes."""
        found = re.fullmatch(r"(ray://)?\[?([^/\[\]]+?)\]?:(\d{1,5})", self.address)
        if found is None:
            return  # local, auto, or what Ray refuses at once
        try:
            socket.create_connection((found[2], int(found[3])), ANSWERS_WITHIN).close()
        except (OSError, OverflowError, UnicodeError) as error:
            raise self._refusal(f"nothing answers there ({short(str(error))})") from None
        if found[1]:
            return  # Ray's own client has a bound
        status = [sys.executable, "-m", "ray.scripts.scripts", "status", "--address", self.address]
        try:
            done = subprocess.run(status, capture_output=True, check=False, timeout=FOUND_WITHIN)
        except subprocess.TimeoutExpired:
            raise self._refusal(f"no cluster is found there within {FOUND_WITHIN:g} s") from None
        if done.returncode:
            lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
            raise self._refusal(
                f"no cluster is found there ({short(lines[-1] if lines else 'no reason said')})"
            )

    def _refusal(self, why: str) -> InputError:
        return InputError(
            f"--cluster: {self.address}: {why}; expected the address of a running cluster, or local; "
            "start one with: ray start --head"
        )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Cancel what is in flight by disconnecting; a local cluster ends."""
        self.ray.shutdown()

    def run(self, work: Callable[[T], R], items: Iterable[T]) -> Iterator[Outcome[T, R]]:
        """Do the work; see `posekit.batch.pool.Pool`."""
        task = self.ray.remote(num_cpus=1, max_retries=self.retries)(attempt)
        limit = TASKS_AHEAD * max(1, int(self.ray.cluster_resources().get("CPU", 1)))
        waiting = iter(items)
        flying: dict[Any, T] = {task.remote(work, item): item for item in islice(waiting, limit)}
        while flying:
            done, _ = self.ray.wait(list(flying), num_returns=1)
            item = flying.pop(done[0])
            for following in islice(waiting, 1):
                flying[task.remote(work, following)] = following
            yield self._outcome(done[0], item)

    def _outcome(self, reference: Any, item: Any) -> Outcome[Any, Any]:
        try:
            report = self.ray.get(reference)
        except self.ray.exceptions.RayError as error:
            return Outcome(
                item=item,
                value=None,
                error=f"its worker died: {short(str(error))}",
                attempts=self.retries + 1,
                died=True,
            )
        return Outcome(
            item=item, value=report.value, error=report.error, fatal=report.fatal, peak=report.peak
        )


@contextmanager
def _loopback() -> Iterator[None]:
    """Let Ray listen on 127.0.0.1 alone, as it does by itself where there are no clusters: on Windows and macOS.

    The switch is for the processes that it starts; here it was read when Ray was imported.
    """
    constants: Any = import_module("ray._private.ray_constants")
    kept = os.environ.get(LOOPBACK_SWITCH), getattr(constants, "ENABLE_RAY_CLUSTER", True)
    os.environ[LOOPBACK_SWITCH], constants.ENABLE_RAY_CLUSTER = "0", False
    try:
        yield
    finally:
        os.environ.pop(LOOPBACK_SWITCH)
        if kept[0] is not None:
            os.environ[LOOPBACK_SWITCH] = kept[0]
        constants.ENABLE_RAY_CLUSTER = kept[1]
