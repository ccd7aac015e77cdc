"""What surrounds and carries an object: flight, camera rigs, sky, landscape, sensor."""
