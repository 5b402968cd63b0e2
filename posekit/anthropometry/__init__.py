"""How long a person's segments are: from stature, from named proportions, from recordings of the person."""
