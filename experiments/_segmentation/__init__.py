"""What `measure_segmentation` is made of: masks that are found, and what an object is taken for by them."""
