"""MambaSplat-4D: vector-neuron encoder over Gaussians, Mamba over time."""
