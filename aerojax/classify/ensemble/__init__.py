"""Several networks of one kind, trained side by side, whose probabilities are averaged."""
