"""One file, one act: `python -m experiments.<verb_object>`."""
