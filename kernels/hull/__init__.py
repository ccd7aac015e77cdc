"""The visual hull of a frame's silhouettes; its JAX twin is `aerojax.reconstruct.hull`."""
