"""Fuzzing of readers: mutated files, and processes that read them under limits."""
