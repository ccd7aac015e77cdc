"""Everything that is wrong with a capture, found before an image is decoded."""
