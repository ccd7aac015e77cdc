"""The released PyTorch code's weights and rules."""
