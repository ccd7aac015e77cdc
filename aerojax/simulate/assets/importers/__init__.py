"""Users' own models: glTF, OBJ and USD files as identities of the catalogue."""
