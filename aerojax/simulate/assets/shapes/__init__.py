"""shapes-10: ten kinds of simple upright things, for trying out what is trained on objects of ModelNet."""
