"""Users' own models: glTF, OBJ, STL, PLY and USD files as identities of the catalogue."""
