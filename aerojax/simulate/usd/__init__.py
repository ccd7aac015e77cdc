"""USD stages: written for assets and sequences, read back as animated meshes."""
