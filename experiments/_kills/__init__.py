"""Which acts are killed, and what they work on."""
