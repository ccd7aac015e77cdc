"""Ray casting of triangle meshes in Warp."""
