"""The `posekit` command: its commands, its errors and its exit codes."""

from __future__ import annotations

import sys
import warnings
from typing import Annotated, Any, TextIO

import typer

from posekit.cli import (
    batch,
    convert,
    demo,
    evaluate,
    inspect,
    recover,
    render,
    reproduce,
    synth,
    validate,
    view,
)
from posekit.cli.options import examples
from posekit.errors import PosekitError

BAD_INPUT = 2

# Typer brings click along in its own name space, or takes the installed one, version by version.
UsageError: Any = typer.BadParameter.__bases__[0]
ClickError: Any = UsageError.__bases__[0]

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
app.command("recover", epilog=recover.EXAMPLES)(recover.recover)
app.command("validate", epilog=validate.EXAMPLES)(validate.validate)
app.command("convert", epilog=convert.EXAMPLES)(convert.convert)
app.command("inspect", epilog=inspect.EXAMPLES)(inspect.inspect)
app.command("evaluate", epilog=evaluate.EXAMPLES)(evaluate.evaluate)
app.add_typer(synth.app, name="synth")
app.command("reproduce", epilog=reproduce.REPRODUCE_EXAMPLES)(reproduce.reproduce)
app.command("batch", epilog=batch.EXAMPLES)(batch.batch)
app.command("render", epilog=render.EXAMPLES)(render.render)
app.command("view", epilog=view.EXAMPLES)(view.view)
app.command("demo", epilog=demo.DEMO_EXAMPLES)(demo.demo)


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"posekit {version('posekit')}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Every physically possible posture behind one view, each certified."""


def main() -> None:
    """Run the command line: 0 done, 1 some postures are not valid, 2 bad input; errors are one line."""
    warnings.showwarning = _warn
    try:
        code = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except PosekitError as error:
        code = _fail(str(error))
    except UsageError as error:
        hint = f"; see {error.ctx.command_path} --help" if error.ctx else ""
        code = _fail(error.format_message().rstrip(".") + hint)
    except ClickError as error:
        code = _fail(error.format_message())
    except (typer.Abort, KeyboardInterrupt):
        code = _fail("interrupted", 130)
    except BrokenPipeError:
        sys.stderr.close()
        code = 1
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str, code: int = BAD_INPUT) -> int:
    typer.echo(f"posekit: error: {' '.join(message.split())}", err=True)
    return code


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning to the user as one line, without the place in the code; others are for developers."""
    if not issubclass(category, UserWarning):
        return
    typer.echo(f"posekit: warning: {' '.join(str(message).split())}", err=True)
