"""Ray-cast images of moving objects before a dome or a landscape."""
