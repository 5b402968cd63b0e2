"""Tables in TOML, one kind a file: what each may hold, as a pydantic model, before anything is made of it.

`posekit.tables.file_model` has what all files share, and turns the first error of a model into one line. Nothing is
imported here: who reads a table imports its model then, and a command that reads none loads none.
"""
