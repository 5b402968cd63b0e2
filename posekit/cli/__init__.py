"""The `posekit` command: one command a file."""
