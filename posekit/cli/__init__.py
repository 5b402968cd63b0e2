"""The command line: one command a file; what a command needs is imported when it runs."""

from posekit.cli.main import main as main
