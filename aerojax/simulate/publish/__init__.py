"""What a data set says of itself: manifest, card, Croissant metadata."""
