"""What a machine can do, asked of the machine itself."""
