"""Cameras as other tools write them, and guesses where none is known."""
