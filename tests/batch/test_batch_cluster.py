"""A Ray cluster: who can reach it, what it prints, and an address where there is none."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from posekit import batch
from posekit.batch import ray_pool
from posekit.batch.ray_pool import RayPool
from posekit.errors import InputError

LOOPBACK = {"0100007F", "0000000000000000FFFF00000100007F", "00000000000000000000000001000000"}
"""127.0.0.1, the same as IPv6 has it, and ::1, as /proc/net has them."""
LISTENING = "0A"


def listening() -> dict[str, set[str | None]]:
    """Map this process and all below it to the addresses at which they listen."""
    addresses = {}
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == LISTENING:
                addresses[f"socket:[{fields[9]}]"] = fields[1].partition(":")[0]
    parents = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # ended since
            head, _, state = entry.read_text().rpartition(") ")
            parents[int(entry.parent.name)] = (int(state.split()[1]), head.partition("(")[2])
    found: dict[str, set[str | None]] = {}
    for process, (_, name) in parents.items():
        above = process
        while above not in (0, os.getpid()):
            above = parents.get(above, (0, ""))[0]
        if above == os.getpid():
            for handle in Path(f"/proc/{process}/fd").glob("*"):
                with suppress(OSError):  # closed since
                    address = addresses.get(str(handle.readlink()))
                    found.setdefault(name, set()).update({address} - {None})
    return found


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="the system has no /proc")
def test_a_local_cluster_listens_to_this_machine_alone() -> None:
    pytest.importorskip("ray")
    before = dict(os.environ)
    with RayPool("local", jobs=1, retries=0) as pool:
        (outcome,) = pool.run(abs, [-3])
        assert outcome.value == 3
        found = listening()
    assert {"gcs_server", "raylet"} <= found.keys()
    assert found["gcs_server"] and found["raylet"]
    assert {address for addresses in found.values() for address in addresses} <= LOOPBACK
    assert {name: value for name, value in os.environ.items() if "RAY_ENABLE" in name} == {
        name: value for name, value in before.items() if "RAY_ENABLE" in name
    }


def test_a_port_of_something_else_is_refused_within_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ray")
    monkeypatch.setattr(ray_pool, "FOUND_WITHIN", 5.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with pytest.raises(
            InputError, match=f"127.0.0.1:{port}: no cluster is found there within 5 s; expected"
        ):
            RayPool(f"127.0.0.1:{port}", jobs=1, retries=0).__enter__()


def test_what_others_print_meanwhile_is_not_in_the_output(
    tmp_path: Path, command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ray prints from a thread of its own that a worker died, as soon as one does."""
    (tmp_path / "view.json").write_text("{")

    def notice(*_: object, **__: object) -> None:
        print("(raylet) A worker died")
        raise InputError("nothing to do")

    monkeypatch.setattr(batch, "run_batch", notice)
    done = command("batch", tmp_path / "view.json", "-o", tmp_path / "out", "--cluster", "local")
    assert (done.code, done.out) == (2, "")
    assert "(raylet)" in done.err
