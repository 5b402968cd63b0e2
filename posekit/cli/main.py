"""The `posekit` command: its subcommands, error messages and exit codes."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from importlib import import_module
from typing import Any, Final

import click

from posekit import __version__
from posekit.cli.command import progress_bar, say
from posekit.errors import PosekitError, nearest, refusal
from posekit.progress import show_with

BAD_INPUT: Final = 2
INTERRUPTED: Final = 130
TERMINATED: Final = 143

#: Commands in the order of the help; each is a module of `posekit.cli` with a function of the same name.
COMMANDS: Final = {
    "validate": "Check postures, motion and folders: report defects, and which clips to keep.",
    "recover": "Recover every posture that fits a view: exact image points, key points or a photograph.",
    "render": "Draw postures, motion, results and reports as a picture, an animation or a page.",
    "view": "Show a file as a page in the browser.",
    "convert": "Convert a file to another format.",
    "inspect": "Print the content of a file: kind, layout, frames, rate, axes, unit and names.",
    "follow": "Recover the posture of a person live, one line of key points at a time.",
    "batch": "Recover or validate all files of an archive; a stopped run can be continued.",
    "evaluate": "Compare recovered postures with the true postures.",
    "synth": "Make synthetic views of known postures: a walker, random postures, motion capture, an object.",
    "reproduce": "Compute the tables and figures of Lee & Chen (1985) and Taylor (2000).",
    "samples": "Write small sample files into a folder.",
    "settings": "List the settings of a command with their defaults.",
    "demo": "Run validation, recovery and reproduction on built-in files.",
}


class Commands(click.Group):
    """The group of commands; each command is imported when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the commands in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command:
        """Import a command."""
        if name not in COMMANDS:
            remedy = nearest(name, COMMANDS, "see posekit --help")
            if name == "repair":
                remedy = "write posekit validate FILE --repair OUTPUT"
            raise refusal("posekit", name, "an unknown command", ", ".join(COMMANDS), remedy)
        module = import_module(f"posekit.cli.{name}")
        found: click.Command = getattr(module, name)
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands in the help without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=Commands, no_args_is_help=True)
@click.version_option(__version__, message="posekit %(version)s")
def posekit() -> None:
    """Validate human and humanoid postures and motion, and recover every posture that fits one view."""


class Terminated(BaseException):
    """The process received SIGTERM; incomplete files are removed while this exception propagates."""


def main() -> None:
    """Run the command line. Exit codes: 0 success, 1 a negative result such as invalid postures, 2 wrong input."""
    warnings.showwarning = _warn
    signal.signal(signal.SIGTERM, _terminate)
    show_with(progress_bar if sys.stderr.isatty() else None)
    try:
        code = posekit.main(prog_name="posekit", standalone_mode=False)
    except (click.Abort, KeyboardInterrupt):
        code = _fail("interrupted", INTERRUPTED)
    except Terminated:
        code = _fail("terminated", TERMINATED)
    except click.exceptions.Exit as ended:
        code = ended.exit_code
    except PosekitError as error:
        code = _fail(str(error))
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        code = 0
    except click.UsageError as error:
        words = error.ctx.command_path.split()[1:] if error.ctx else []
        where = f"; see posekit {' '.join(words)} --help" if words else ""
        said = error.format_message().rstrip(".")
        if said.startswith("Got unexpected extra") and "recover" in where:
            said += "; give the files of several pictures as their folder"
        code = _fail(said + where)
    except click.ClickException as error:
        code = _fail(error.format_message())
    except BrokenPipeError:
        # The remaining output has no reader.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    except MemoryError:
        code = _fail("not enough memory; expected some 300 MB besides the input; give fewer frames at a time")
    except OSError as error:
        place = f"{error.filename}: " if error.filename is not None else ""
        code = _fail(f"{place}{error.strerror or error}; expected a file or folder that can be used")
    sys.exit(code if isinstance(code, int) else 0)


def _terminate(number: int, frame: Any) -> None:
    raise Terminated


def _fail(message: str, code: int = BAD_INPUT) -> int:
    say(f"posekit: error: {' '.join(message.split())}", err=True)
    return code


def _warn(message: Warning | str, category: type[Warning], *args: Any, **kwargs: Any) -> None:
    """Print a warning for users in one line; suppress warnings for developers."""
    if issubclass(category, UserWarning):
        say(f"posekit: warning: {' '.join(str(message).split())}", err=True)
