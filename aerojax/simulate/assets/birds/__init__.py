"""Birds: skinned bodies, cambered wings, wing beats."""
