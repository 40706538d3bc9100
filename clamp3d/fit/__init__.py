"""Own parts: grooves, cylinders and holes fitted to a triangle mesh, each with its covariance and error bound."""
