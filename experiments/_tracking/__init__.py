"""What `measure_tracking` is made of: flights without images, captures with them, and figures of both."""
