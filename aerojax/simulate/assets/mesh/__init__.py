"""Triangle meshes that assets are built of."""
