"""Stage 3: MambaSplat-4D, from clips of Gaussians to class logits."""
