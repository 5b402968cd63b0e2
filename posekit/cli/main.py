"""The `posekit` command: its commands, its errors and its exit codes."""

from __future__ import annotations

import atexit
import gc
import os
import sys
import warnings
from importlib import import_module
from typing import Annotated, Any, Final, TextIO

import typer

from posekit.cli.guarded_command import GuardedCommand
from posekit.cli.options import examples, on_terminal
from posekit.cli.signals import take_signals
from posekit.cli.terminal import INTERRUPTED_CODE, Ended, say
from posekit.compiled.compiling import when_compiling
from posekit.errors import PosekitError

BAD_INPUT = 2

NEW_OBJECTS_PER_COLLECTION = 100_000
"""Containers made between two collections of garbage, in a process of the command."""

SYSTEM_REMEDIES: Final = {"libgomp.so.1": "on Debian and Ubuntu run: apt-get install libgomp1"}
"""By library of the system that packages of ours load and do not bring: how to get it."""

# Typer brings click along in its own name space, or takes the installed one, version by version.
UsageError: Any = typer.BadParameter.__bases__[0]
ClickError: Any = UsageError.__bases__[0]

COMMAND_NAMES: Final = (
    "recover",
    "follow",
    "validate",
    "convert",
    "inspect",
    "evaluate",
    "synth",
    "reproduce",
    "batch",
    "render",
    "view",
    "demo",
    "samples",
)
"""In the order of the help; each has its own module of that name."""


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        say(f"posekit {version('posekit')}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Every physically possible posture behind one view, each certified."""


def application(first: str) -> typer.Typer:
    """Make the command line: of the command that is named `first` alone, or of all where that is no command."""
    app = typer.Typer(
        name="posekit",
        help="Every physically possible posture behind one view, each certified.",
        epilog=examples(
            "posekit demo -o demo-results",
            "posekit synth walker -o walk.json && posekit recover walk.json -o postures.json",
            "posekit recover --help",
        ),
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    app.callback()(_root)
    # What reads the options of a command takes some milliseconds to make: those of the others are not needed.
    for name in (first,) if first in COMMAND_NAMES else COMMAND_NAMES:
        module = import_module(f"posekit.cli.{name}")
        if name == "synth":
            app.add_typer(module.app, name=name)
        else:
            examples_of = getattr(module, f"{name.upper()}_EXAMPLES")
            app.command(name, epilog=examples_of, cls=GuardedCommand)(getattr(module, name))
    return app


def _misused(error: Any, command: str) -> str:
    """Say what is wrong with a command's words, and where to look."""
    said: str = error.format_message().rstrip(".")
    if said.startswith("Got unexpected extra") and command == "recover":
        said += "; files of several pictures are given as their folder"
    return said + (f"; see {error.ctx.command_path} --help" if error.ctx else "")


def _tell_of_compiling() -> None:
    say("compiling loops for this machine, once: half a minute", err=True)


def main() -> None:
    """Run the command line: 0 done, 1 some postures are not valid, 2 bad input; errors are one line."""
    warnings.showwarning = _warn
    # Importing makes some hundred thousand objects that stay: looking for garbage among them takes a tenth of a start.
    gc.set_threshold(NEW_OBJECTS_PER_COLLECTION)
    # Before it ends, Python looks for garbage among all of it: a process that ends gives everything back anyway.
    atexit.register(gc.freeze)
    # Models of files have no plugins: looking for some reads the metadata of all that is installed.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    when_compiling(_tell_of_compiling if on_terminal() else None)
    try:
        sys.exit(_run())
    except (typer.Abort, KeyboardInterrupt):
        code = _fail("interrupted", INTERRUPTED_CODE)
    except Ended as ended:
        code = _fail(str(ended), ended.code)
    sys.exit(code)


def _run() -> int:
    """Run the command, say its error, and return the exit code; a signal ends that, too, and is the caller's."""
    try:
        take_signals()
        arguments = sys.argv[1:] or ["--help"]
        code = application(arguments[0])(arguments, standalone_mode=False)
        if callable(code):  # a command with groups of options
            code = code()
    except typer.Exit as ended:
        code = ended.exit_code
    except PosekitError as error:
        code = _fail(str(error))
    except UsageError as error:
        code = _fail(_misused(error, arguments[0]))
    except ClickError as error:
        code = _fail(error.format_message())
    except BrokenPipeError:
        # What is still to be written has no reader: it goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    except ImportError as error:
        # A package that is there and does not load: a shared library of the system is missing.
        library = str(error).partition(":")[0]
        if ".so" not in library:
            raise
        code = _fail(
            f"{library} cannot be loaded, which {error.name or 'a package'} needs; expected that library of the "
            f"system; {SYSTEM_REMEDIES.get(library, 'install the package of the system that has it')}"
        )
    except MemoryError:
        code = _fail(
            "there is not enough memory for this; expected some 300 MB and what the input needs; "
            "give fewer frames at a time"
        )
    except OSError as error:
        place = f"{error.filename}: " if error.filename is not None else ""
        code = _fail(f"{place}{error.strerror or error}; expected a file or folder that can be used")
    return code if isinstance(code, int) else 0


def _fail(message: str, code: int = BAD_INPUT) -> int:
    _say_line("error", message)
    return code


def _say_line(kind: str, message: str) -> None:
    from posekit.safe_io import bounded  # what --help does not need

    say(f"posekit: {kind}: {bounded(' '.join(message.split()))}", err=True)


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning to the user as one line, without the place in the code; others are for developers."""
    if issubclass(category, UserWarning):
        _say_line("warning", str(message))
