"""Training individuals beyond the published split: mixtures of a class's training families, and variations of them."""
