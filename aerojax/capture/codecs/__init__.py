"""Image and video files: headers, PNG, float TIFF, video."""
