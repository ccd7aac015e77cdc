"""Where pictures come from: folders that grow, recordings that are played, streams of network cameras."""
