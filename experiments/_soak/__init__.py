"""What `measure_soak` tells of a stream without end."""
