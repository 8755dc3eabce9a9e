"""A model in the formats of other programs: URDF, MJCF, SDF, C, NumPy, JSON, LaTeX."""
