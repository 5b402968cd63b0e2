"""How objects show themselves: in a line where they are printed, with a small picture in a notebook."""
