"""Stage 4 that never ends: live sources, frames matched by time, sinks, and a state that outlives the process."""
