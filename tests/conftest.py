"""What every test shares: reproducible examples, a seeded generator, and the command line in this process."""

import contextlib
import importlib
import io
import sys
import warnings
from collections.abc import Callable
from typing import NamedTuple
from unittest import mock

import numpy as np
import pytest
from hypothesis import settings

# The same examples in every run and on every machine; a slow machine is not a failure.
settings.register_profile(
    "posekit", derandomize=True, database=None, deadline=None, max_examples=50, print_blob=True
)
settings.load_profile("posekit")


@pytest.fixture
def rng() -> np.random.Generator:
    """Return a generator that starts the same way in every test."""
    return np.random.default_rng(1985)


class Outcome(NamedTuple):
    """What a command left: its exit code, and what it printed."""

    code: int
    out: str
    err: str


@pytest.fixture(scope="session")
def command() -> Callable[..., Outcome]:
    """Return a function that runs `posekit` with some arguments."""
    main = importlib.import_module("posekit.cli").main

    def run(*arguments: object) -> Outcome:
        out, err = io.StringIO(), io.StringIO()
        with (
            mock.patch.object(sys, "argv", ["posekit", *map(str, arguments)]),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),  # the command prints warnings its own way
        ):
            warnings.simplefilter("default")
            with pytest.raises(SystemExit) as caught:
                main()
        code = caught.value.code
        return Outcome(code if isinstance(code, int) else 0, out.getvalue(), err.getvalue())

    return run
